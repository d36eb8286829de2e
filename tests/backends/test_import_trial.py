"""A plug-in whose import ends the process is a backend that cannot be imported, with a reason."""

import sys
from pathlib import Path

import pytest

from slamduel.backends import registry
from slamduel.backends.import_trial import death
from slamduel.bench.cli import main
from tiers import first_quick

ENDS = {
    "leaves_by_exit": ("raise SystemExit(0)", "cannot be imported: SystemExit: 0"),
    "leaves_at_once": (
        "import os; os._exit(0)",
        "cannot be imported: importing it ends the process with exit status 0",
    ),
    "is_killed": (
        "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
        "cannot be imported: importing it ends the process with SIGSEGV",
    ),
    "is_not_there": ("", "cannot be imported: ModuleNotFoundError: No module named 'is_not_there'"),
}


@pytest.fixture(params=ENDS)
def ending(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of a module that cannot be imported."""
    source = ENDS[request.param][0]
    if source:
        (tmp_path / f"{request.param}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    return request.param


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("ending", first_quick(["leaves_at_once", "leaves_by_exit"]), indirect=True)
def test_its_run_has_a_row_with_the_reason_and_status_1(ending: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "--backend", f"{ending}:build,dead-reckoning", "--dataset", "linear[steps=5]", "--seeds", "1"]
    assert main([*words, "--out", "results"]) == 1
    said = capsys.readouterr().out
    assert f"backend {ending}:build {ENDS[ending][1]}" in said
    assert "done linear" in said


def test_the_conformance_suite_fails(ending: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", f"{ending}:build", "--quiet"]) == 1
    assert f"backend {ending}:build {ENDS[ending][1]}" in capsys.readouterr().out


def test_built_in_backends_start_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "death", lambda module: pytest.fail(f"{module} was tried"))  # pyright: ignore
    assert registry.find_first("dead-reckoning") is registry.find("dead-reckoning")


def test_what_is_imported_here_already_is_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nothing")
    assert death("slamduel.backends.api") == ""
