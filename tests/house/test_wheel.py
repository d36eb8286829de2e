"""What is installed is what is in the repository: the package's files, all of them, under its name, and no others."""

import os
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from places import LAYERS, ROOT
from random_logs import random_log
from slamduel.datasets.formats import log_folder
from sources import built, kept

SETUPTOOLS = 77  # the first to read a licence expression
MODULES = ("__init__.py", "__main__.py", *LAYERS)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy of the files that git has: setuptools writes beside its source."""
    if int(version("setuptools").split(".")[0]) < SETUPTOOLS:
        pytest.skip(f"setuptools {version('setuptools')} is installed, pyproject.toml asks for {SETUPTOOLS}")
    return built(tmp_path_factory.mktemp("wheel"), "wheel")


def test_the_wheel_holds_the_package_and_nothing_else(wheel: Path) -> None:
    packaged = {name for name in kept() if name.split("/")[0] in (*MODULES, "py.typed")}
    assert {"__init__.py", "__main__.py", "py.typed", "backends/api.py", "core/se2.py"} <= packaged
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert inside == {"slamduel/" + name for name in packaged}


@pytest.mark.slow
def test_installed_it_is_imported_from_there(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    code = (
        "import slamduel, slamduel.bench.check.suite as c; "
        "from slamduel.backends import registry as b; from slamduel.datasets import registry as d; "
        "assert all(r.find(name) for r in (b, d) for name in r.BUILTIN); "
        "print(slamduel.__file__); print(c.__file__); "
        "from importlib.metadata import distribution; "
        "print(*{e.value for e in distribution('slamduel').entry_points if e.group == 'console_scripts'})"
    )
    env = os.environ | {"PYTHONPATH": str(site)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=True)
    package, module, script = done.stdout.splitlines()
    assert Path(package) == site / "slamduel" / "__init__.py"
    assert Path(module) == site / "slamduel" / "bench" / "check" / "suite.py"
    assert script == "slamduel.bench.cli:main"


@pytest.mark.slow
def test_installed_it_runs_and_reports(wheel: Path, tmp_path: Path) -> None:
    """With the backend that has no loops of its own, which would be compiled anew; the others are imported above."""
    site, log, out = tmp_path / "site", tmp_path / "log", tmp_path / "out"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    log_folder.write(log, *random_log(np.random.default_rng(1), 20, 5))
    words = ["--backend", "dead-reckoning", "--dataset", log, "--out", out]
    command = [sys.executable, "-m", "slamduel", "run", *words]
    env = os.environ | {"PYTHONPATH": str(site)}
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (out / "report.html").is_file()


def test_every_folder_of_modules_is_listed() -> None:
    """setuptools finds no packages below a root that is a package itself: pyproject.toml lists them."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = tomllib.load(file)["tool"]["setuptools"]["packages"]
    modules = [Path(name) for name in kept() if name.endswith(".py") and name.split("/")[0] in MODULES]
    assert listed == sorted({".".join(("slamduel", *module.parts[:-1])) for module in modules})
