"""The command as a user meets it: exit statuses, sentences, and nothing left where nothing came of it."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import slamduel
from command import refused
from slamduel.bench.cli import main
from slamduel.bench.plan.spec import backend_variants
from slamduel.bench.record.store import Store
from slamduel.core.errors import InputError, Interrupted


def test_run_prints_a_table_and_where_the_report_is(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["run", "--backend", "dead-reckoning,ekf", "--dataset", str(log_folder), "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert all(words in said.out for words in ("dead-reckoning", "ekf", str(out / "report.html")))
    assert (out / "report.html").is_file()
    assert said.err == ""


def test_quiet_prints_nothing(tmp_path: Path, log_folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Nor do its workers, which have the same streams."""
    words = ["--backend", "ekf", "--dataset", str(log_folder), "--out", str(tmp_path / "run")]
    assert main(["run", "--quiet", *words]) == 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("no_report")
def test_json_is_all_of_standard_output(tmp_path: Path, log_folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    words = ["--backend", "ekf", "--dataset", str(log_folder), "--out", str(tmp_path / "run"), "--json"]
    assert main(["run", *words]) == 0
    said = capfd.readouterr()
    found = json.loads(said.out)
    assert (found["status"], found["report"]) == (0, str(tmp_path / "run" / "report.html"))
    assert [dataset["name"] for dataset in found["datasets"]] == [log_folder.name]
    assert "1 of 1 done wander · ekf" in said.err
    assert main(["run", *words, "--quiet"]) == 0
    again = capfd.readouterr()
    assert (json.loads(again.out), again.err) == (found, "")


@pytest.mark.usefixtures("no_report")
def test_a_cell_that_fails_is_exit_status_1(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--backend", "ekf,misbehaving:raises", "--dataset", str(log_folder), "--out", str(tmp_path / "run")]
    assert main(["run", *words]) == 1
    assert "ValueError: the [brackets] of this" in capsys.readouterr().out


@pytest.mark.usefixtures("no_report")  # of the runs: it is `bench report` that has to write one
def test_out_alone_goes_on_and_report_writes_the_files_again(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["run", "--backend", "ekf", "--dataset", str(log_folder), "--out", str(out)]) == 0
    cells = (out / "cells.csv").read_text()
    capsys.readouterr()
    assert main(["run", "--out", str(out)]) == 0
    assert "1 cell in the record already, 0 to be run" in capsys.readouterr().out
    assert (out / "cells.csv").read_text() == cells
    for path in out.iterdir():
        if path.name != "results.sqlite":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert main(["report", str(out)]) == 0
    assert (out / "cells.csv").read_text() == cells
    assert (out / "report.html").is_file()
    assert (out / "report.md").is_file()


@pytest.mark.usefixtures("no_report")
def test_a_misspelt_folder_to_go_on_in_is_asked_about(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "--backend", "ekf", "--dataset", str(log_folder), "--out", str(tmp_path / "monday")]) == 0
    said = refused(capsys, "run", "--out", tmp_path / "mondya")
    assert f"there is no run to continue, did you mean {tmp_path / 'monday'}?" in said
    assert not (tmp_path / "mondya").exists()


@pytest.mark.parametrize("there", ["nothing", "an empty folder", "a record of nothing"])
def test_out_alone_begins_nothing(there: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "other"
    if there != "nothing":
        out.mkdir()
    if there == "a record of nothing":
        (out / "results.sqlite").touch()
    before = sorted(tmp_path.rglob("*"))
    for more in ((), ("--retry",), ("--jobs", "1")):
        said = refused(capsys, "run", "--out", out, *more)
        assert f"--out {out}: there is no run to continue; --backend and --dataset begin one." in said
    with pytest.raises(InputError, match="there is no run to continue; --backend and --dataset begin one"):
        slamduel.run(out=out)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_run_of_nothing_that_was_named_says_what_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(*_: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("slamduel.bench.run.benchmark.run", stopped)
    monkeypatch.chdir(tmp_path)
    assert main(["run"]) == 130
    printed = capsys.readouterr()
    assert "A new run in results/" in printed.out + printed.err
    with pytest.raises(Interrupted):
        slamduel.run(quiet=False)
    printed = capsys.readouterr()
    assert "A new run in results/" in printed.out + printed.err


@pytest.mark.usefixtures("no_report")
def test_another_plan_into_the_same_folder_is_refused(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["run", "--backend", "ekf", "--dataset", str(log_folder), "--out", str(out)]) == 0
    said = refused(capsys, "run", "--backend", "isam2", "--out", out)
    assert "holds a run with backend ekf, found backend isam2" in said
    with Store(out) as store:
        assert [row.columns["backend"] for row in store.cells()] == ["ekf"]


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("odometry.csv, line 9", None),
        ("odometry.csv, line 9", "0.7,x,0,0,1,0,0,1,0,1"),
        ("odometry.csv, line 9", "0.7,nan,0,0,1,0,0,1,0,1"),
        ("odometry.csv, line 9", "0.1,0,0,0,1,0,0,1,0,1"),
        ("odometry.csv, line 9", "0.7,0,0,0,1,2,0,1,0,1"),
        ("sightings.csv, line 3", "0,7,-1,0,1,0,1"),
        ("sightings.csv, line 3", "the line before"),  # an id twice in a frame
    ],
)
def test_a_damaged_log_is_named_by_file_and_line(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str], line: str, text: str | None
) -> None:
    """One line (1 is the header) is replaced, or the file cut off there."""
    folder = shutil.copytree(log_folder, tmp_path / "log")
    name, _, number = line.partition(", line ")
    lines, k = (folder / name).read_text().splitlines(), int(number) - 1
    text = lines[k - 1] if text == "the line before" else text
    lines[k:] = [lines[k][:7]] if text is None else [text, *lines[k + 1 :]]
    (folder / name).write_text("\n".join(lines) + "\n")
    said = refused(capsys, "run", "--backend", "ekf", "--dataset", folder, "--out", tmp_path / "made" / "run")
    assert line in said
    assert "expected" in said
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(
    ("place", "said"),
    [("a-file/run", "--out {}: "), ("a-file", "--out {}: "), (".", "found no run; expected a new or empty folder")],
)
def test_a_place_that_is_not_for_a_run_is_named_and_left_alone(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str], place: str, said: str
) -> None:
    (tmp_path / "a-file").write_text("precious")
    out = tmp_path / place
    assert said.format(out) in refused(capsys, "run", "--backend", "ekf", "--dataset", log_folder, "--out", out)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["precious"]


@pytest.mark.parametrize("content", [b"not a database", b""])
def test_report_of_what_is_no_run_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    (tmp_path / "results.sqlite").write_bytes(content)
    assert str(tmp_path) in refused(capsys, "report", tmp_path)


def test_list_names_everything_with_its_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for words in ("dead-reckoning", "ekf", "isam2", "graph", "particles=500", "victoria-park", "markers=24", "robot=1"):
        assert words in said
    assert "isam2 (GTSAM's wheel)" in said
    assert "smoother (compiled here)" in said


def test_list_is_json_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (fastslam,) = [entry for entry in found["backends"] if entry["name"] == "fastslam"]
    assert {option["name"]: option["default"] for option in fastslam["options"]}["particles"] == "500"
    assert "victoria-park" in [entry["name"] for entry in found["datasets"]]
    whose = {entry["name"]: entry["implementation"] for entry in found["backends"]}
    assert (whose["ekf"], whose["isam2"]) == ("compiled here", "GTSAM's wheel")
    assert not any("implementation" in entry for entry in found["datasets"])


def test_check_holds_a_backend_to_the_contract(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "dead-reckoning", "--only", "contract,estimates"]) == 0
    assert "passed" in capsys.readouterr().out
    assert main(["check", "misbehaving:not_a_number", "--only", "contract,estimates"]) == 1
    assert "failed" in capsys.readouterr().out
    assert main(["check", "misbehaving:not_there"]) == 1
    assert "cannot be imported" in capsys.readouterr().out
    assert main(["check", "dead-reckoning", "--only", "contract"]) == 0
    assert "not applicable; makes no use of sightings" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "--seeds", "0"], "run: --seeds: found 0, expected a whole number, at least 1"),
        (["run", "--seeds", "many"], "run: --seeds: found many, expected a whole number, at least 1"),
        (["run", "--timeout", "-1"], "run: --timeout: found -1, expected "),
        (["show", "circle", "--seed", "-1"], "show: --seed: found -1, expected a whole number, at least 0"),
        (["run", "--seeds"], "run: --seeds: expected one argument"),
    ],
)
def test_a_bad_value_of_an_option_is_one_sentence(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(words) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"bench: {said}")
    assert err.endswith(".\n")
    assert err.count("\n") == 1


def test_a_stretch_without_end_is_refused_and_a_whole_one_is_written_as_given(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for text in ("inf", "nan", "-1"):
        assert main(["run", "--backend", f"smoother[keep={text}]"]) == 2
        assert "option keep=" in capsys.readouterr().err
    labels = [one.label for one in backend_variants("smoother[keep=20],smoother[keep=2.5]")]
    assert labels == ["smoother[keep=20]", "smoother[keep=2.5]"]
    (again,) = backend_variants("smoother[keep=20.0]")
    assert again.label == labels[0]
    assert isinstance(again.options.keep, float)


@pytest.mark.parametrize("command", ["show", "validate", "noise"])
def test_a_runs_folder_is_no_log_and_the_commands_for_it_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "results.sqlite").touch()
    said = refused(capsys, command, run)
    assert f"{run}: found the folder of a run or a study, expected a log" in said
    assert f"`bench report {run}`" in said
    assert f"`bench replay {run}`" in said


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"]])
def test_help_is_printed(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 0
    assert "bench" in capsys.readouterr().out


@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m slamduel.bench.cli list | head -1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_terminal_without_the_letters_is_no_error(tmp_path: Path, log_folder: Path) -> None:
    env = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = ("run", "--backend", "ekf", "--dataset", log_folder, "--out", tmp_path / "run")
    command = [sys.executable, "-m", "slamduel.bench.cli", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, env=env, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.usefixtures("no_report")
def test_brackets_in_a_place_are_no_markup(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for out in ("m[/x]", "c[x]"):
        assert main(["run", "--backend", "dead-reckoning", "--dataset", str(log_folder), "--out", out]) == 0
        assert f"report: {out}/report.html" in capsys.readouterr().out
    for out in ("m[/x]", "c[x]"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("slamduel.bench.report.report.write_report", lambda store, figures: None)
            assert main(["report", out]) == 0
        assert capsys.readouterr().out == f"report: {out}/report.html\n"
        assert main(["export", str(log_folder), "--as", "log", "--out", f"{out}-log"]) == 0
        assert f"{out}-log/log: " in capsys.readouterr().out


@pytest.mark.slow
def test_an_interrupt_before_anything_is_there_is_a_sentence(tmp_path: Path, log_folder: Path) -> None:
    """The fork server gets Ctrl-C too, while it still imports, and says nothing; nor is there a run to go on with."""
    out = tmp_path / "run"
    words = ["run", "--backend", "ekf", "--dataset", str(log_folder), "--out", str(out)]
    command = [sys.executable, "-m", "slamduel.bench.cli", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0)
    deadline = time.monotonic() + 60
    while not importing(process.pid):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)
    said, err = process.communicate(timeout=60)
    assert (process.returncode, said.removeprefix("preparing 1 log\n")) == (130, "")
    assert err == f"bench: interrupted; no cell was begun, and {out} holds nothing of this run.\n"
    assert not out.exists()


def importing(group: int) -> bool:
    """Whether the fork server in a group of processes is in the midst of its imports."""
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            member = int((entry / "stat").read_text().rpartition(")")[2].split()[2]) == group
            if member and b"multiprocessing.forkserver" in (entry / "cmdline").read_bytes():
                return "numpy" in (entry / "maps").read_text()
    return False


def test_a_quoted_path_is_validated(tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(log_folder, tmp_path / "x,y" / "br[1]")
    assert main(["validate", f'"{tmp_path}/x,y/br[1]"']) == 0
    assert "good; 40 steps" in capsys.readouterr().out


def test_a_picture_goes_to_where_a_link_leads(tmp_path: Path, log_folder: Path) -> None:
    (tmp_path / "far").mkdir()
    link = tmp_path / "link.png"
    link.symlink_to(tmp_path / "far" / "picture.png")
    assert main(["show", str(log_folder), "--out", str(link), "--quiet"]) == 0
    assert link.is_symlink()
    assert (tmp_path / "far" / "picture.png").read_bytes().startswith(b"\x89PNG")


LOST = """
import ctypes, os, signal, sys, time
from slamduel.bench.cli import ended_gently

@ctypes.CFUNCTYPE(None)
def terminated():
    os.kill(os.getpid(), signal.SIGTERM)
    while True:
        pass

try:
    with ended_gently():
        terminated()
        print("lost", flush=True)
        time.sleep(60)
except KeyboardInterrupt:
    print("ended")
"""


def test_an_interrupt_inside_a_callback_from_c_ends_the_command() -> None:
    done = subprocess.run([sys.executable, "-c", LOST], check=False, capture_output=True, text=True, timeout=50)
    assert (done.returncode, done.stdout.splitlines(), done.stderr) == (0, ["lost", "ended"], "")
