"""Whose program a backend is: what it says itself, and what is said of one that does not."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from slamduel.backends import registry
from slamduel.backends.api import COMPILED_HERE, GTSAM_WHEEL, Builder
from slamduel.backends.gaussian.dead_reckoning import DeadReckoning

IMPORTED = """
import sys
from slamduel.backends import registry
for name in sys.argv[1:]:
    registry.find(name)
sys.exit("gtsam" in sys.modules)
"""

OTHERS = {
    "g2o": "g2o's wheel",
    "isam2": GTSAM_WHEEL,
    "mrpt-ekf": "MRPT, compiled here",
    "symforce": "SymForce's wheel, NumPy",
    "textbook-ekf": "NumPy, as printed",
    "textbook-fastslam": "NumPy, as printed",
}
"""Of those that are not compiled here, or not by this package alone."""

MODULE = """
from slamduel.backends.api import Builder
from slamduel.backends.gaussian.dead_reckoning import DeadReckoning

build = Builder(DeadReckoning)
"""


@dataclass(frozen=True)
class Solver:
    solver: str = "own"


def by_solver(options: Solver) -> str:
    return GTSAM_WHEEL if options.solver == "gtsam" else COMPILED_HERE


@pytest.mark.parametrize("name", registry.BUILTIN)
def test_what_comes_along_says_whose_program_it_is(name: str) -> None:
    said = registry.implementation(name, registry.find(name).options())
    assert said == OTHERS.get(name, COMPILED_HERE)


def test_what_is_compiled_here_does_not_even_load_gtsam() -> None:
    """Of those that are so with any options; asked in a process that has loaded none of the others."""
    names = [name for name in registry.BUILTIN if registry.find(name).implementation == COMPILED_HERE]
    assert {"ekf", "fastslam", "smoother"} <= set(names)
    done = subprocess.run([sys.executable, "-c", IMPORTED, *names], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_options_may_choose_between_programs() -> None:
    builder = Builder(DeadReckoning, options=Solver, implementation=by_solver)
    assert [builder.implemented(Solver(name)) for name in ("own", "gtsam")] == [COMPILED_HERE, GTSAM_WHEEL]


def test_a_plug_in_that_does_not_say_is_named_by_what_installed_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "silent_backend.py").write_text(MODULE)
    (tmp_path / "broken_backend.py").write_text(
        MODULE.replace("Reckoning)", "Reckoning, implementation=lambda _: 1 / 0)")
    )
    monkeypatch.syspath_prepend(tmp_path)
    for module in ("silent_backend", "broken_backend"):
        assert registry.implementation(f"{module}:build", None) == registry.NOT_STATED
    registry.distributions.cache_clear()
    installed = tmp_path / "silent-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: silent\nVersion: 1.0\n")
    (installed / "RECORD").write_text("silent_backend.py,,\n")
    assert registry.implementation("silent_backend:build", None) == "from silent"
    (installed / "entry_points.txt").write_text("[slamduel.backends]\nquiet = silent_backend:build\n")
    assert registry.implementation("quiet", None) == "from silent"
