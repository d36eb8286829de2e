"""What a release is made of: its archive, its version, its citation, and the files that other machines read."""

import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from places import LAYERS, ROOT
from sources import built, kept

WORKFLOWS = ("tests", "publish")


def loaded(name: str) -> Any:
    return YAML(typ="safe").load((ROOT / name).read_text())


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]


@pytest.fixture(scope="module")
def targets() -> set[str]:
    return set(re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE))


@pytest.mark.slow
def test_the_source_archive_holds_all_that_git_has(tmp_path: Path) -> None:
    with tarfile.open(built(tmp_path, "sdist")) as tar:
        inside = {name.partition("/")[2] for name in tar.getnames() if not tar.getmember(name).isdir()}
    assert set(kept()) - inside == {".gitignore"}
    made = {name for name in inside - set(kept()) if not name.startswith("slamduel.egg-info/")}
    assert made == {"PKG-INFO", "setup.cfg"}


def test_python_dash_m_is_the_command() -> None:
    command = [sys.executable, "-m", "slamduel", "list", "nothing"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "bench: list: found 'nothing', which belongs to no option" in done.stderr


def test_the_citation_is_of_this_version(project: dict[str, Any]) -> None:
    """The keys that version 1.2.0 of the format requires, and those that the package also states."""
    citation = loaded("CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert citation["authors"]
    assert (citation["version"], citation["license"]) == (project["version"], project["license"])
    assert citation["keywords"] == project["keywords"]


def test_the_workflow_tests_every_python_that_the_package_names(project: dict[str, Any]) -> None:
    classified = [one.split(" :: ") for one in project["classifiers"]]
    named = [words[-1] for words in classified if words[1:2] == ["Python"] and "." in words[-1]]
    matrix = loaded(".github/workflows/tests.yml")["jobs"]["quick"]["strategy"]["matrix"]
    assert matrix["python"] == named
    assert project["requires-python"] == f">={named[0]}"
    systems = {words[-1] for words in classified if words[0] == "Operating System"}
    assert systems == {"MacOS", "Linux"}
    assert {one.split("-")[0] for one in matrix["os"]} == {"ubuntu", "macos"}


def test_the_workflows_and_the_hooks_run_what_exists(targets: set[str]) -> None:
    jobs = [job for name in WORKFLOWS for job in loaded(f".github/workflows/{name}.yml")["jobs"].values()]
    runs = [step["run"] for job in jobs for step in job["steps"] if "run" in step and "name" not in step]
    hooks = [hook["entry"] for repository in loaded(".pre-commit-config.yaml")["repos"] for hook in repository["hooks"]]
    assert runs
    assert hooks
    for command in (*runs, *hooks):
        tool, _, target = command.partition(" ")
        assert target in targets if tool == "make" else (ROOT / tool).is_file(), command


def test_a_tag_publishes_the_archives_that_were_tested() -> None:
    publish = loaded(".github/workflows/publish.yml")
    assert publish["on"] == {"push": {"tags": ["v*"]}}
    archives, published = publish["jobs"]["archives"], publish["jobs"]["publish"]
    assert published["needs"] == "archives"
    assert "permissions" not in archives
    assert published["permissions"] == {"id-token": "write"}
    steps = [step.get("run") or step["uses"].partition("@")[0] for step in archives["steps"]]
    assert steps.index("make test-dist") < steps.index("actions/upload-artifact")
    used = [step["uses"].partition("@")[0] for step in published["steps"]]
    assert used == ["actions/download-artifact", "pypa/gh-action-pypi-publish"]
    assert archives["steps"][-1]["with"]["name"] == published["steps"][0]["with"]["name"]


def test_numba_is_bounded_by_what_the_tests_run_with(project: dict[str, Any]) -> None:
    (bounds,) = (one.removeprefix("numba") for one in project["dependencies"] if one.startswith("numba"))
    (minor,) = re.findall(r"^numba==0\.(\d+)\.", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
    assert re.fullmatch(rf">=0\.\d+,<0\.{int(minor) + 1}", bounds)


def test_the_workflow_keeps_the_kernels_of_every_layer() -> None:
    (kept,) = (
        step["with"]
        for step in loaded(".github/workflows/tests.yml")["jobs"]["quick"]["steps"]
        if step.get("uses", "").startswith("actions/cache@")
    )
    assert kept["path"].split() == [f"{layer}/**/*.nb[ic]" for layer in sorted(LAYERS)]
    assert kept["key"].startswith(kept["restore-keys"])
    assert "core/kernels/compiled.py" in kept["restore-keys"]  # no stamp has it: another one compiles otherwise


def test_an_entry_of_the_changelog_is_one_line_whose_links_lead_somewhere() -> None:
    entries = [line for line in (ROOT / "CHANGELOG.md").read_text().partition("\n## ")[2].splitlines() if line]
    assert entries
    for entry in entries:
        assert entry.startswith(("- ", "## [", "### ")) or entry[0] == "[", entry
        assert len(entry) < 160, entry
        assert not entry.startswith("- ") or "](" in entry, entry
        for name, _, place in (link.partition("#") for link in re.findall(r"\]\(([^):]+)\)", entry)):
            headings = re.findall(r"^#+ (.*)$", (ROOT / name).read_text(), re.MULTILINE)
            anchors = {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}
            assert not place or place in anchors, entry


def test_the_image_installs_what_the_package_offers(project: dict[str, Any]) -> None:
    text = (ROOT / "Dockerfile").read_text()
    (extras,) = re.findall(r"'/source\[([\w,]+)\]'", text)
    assert set(extras.split(",")) <= set(project["optional-dependencies"])
    (python,) = re.findall(r"^FROM python:(\d\.\d+)", text, re.MULTILINE)
    assert f"Programming Language :: Python :: {python}" in project["classifiers"]
    (command,) = re.findall(r'^ENTRYPOINT \["(\w+)"\]', text, re.MULTILINE)
    assert command in project["scripts"]
