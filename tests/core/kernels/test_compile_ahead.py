"""Two processes compile what is listed, each from one end, and nothing twice."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import slamduel.core.kernels.compile_ahead as ahead
import slamduel.core.kernels.compiled as compiled

LOOPS = """
from .compiled import compiled

@compiled
def shared(x):
    return x + 1

{loops}
"""
LISTED = """
from . import _loops
def kernels():
    return [(getattr(_loops, f"loop{k}"), (1.0,)) for k in range(8)]
"""
ASK = (
    "from house import _loops, compiled; from house.compile_ahead import compile_ahead; "
    "compile_ahead('house.listed'); print(_loops.loop3(1.0), compiled.ready(), compiled.made())"
)
COVERED = """
import numpy as np
from slamduel.backends.smoothing import kernels
from slamduel.backends.incremental.smoother import Options, Smoother
from slamduel.datasets import registry
from slamduel.core.kernels import compile_ahead, compiled

compile_ahead._compile(kernels.kernels())
before = compiled.ready()
source = registry.find("circle")
made = source.make(source.options(steps=300), np.random.default_rng(0))
backend = Smoother(made.log.prior, Options(), np.random.default_rng(0))
for step in made.log:
    backend.step(step)
backend.map(), backend.belief(), backend.finish()
print(compiled.ready() - before)
"""


IN_THE_ROOM = """
import numpy as np
from slamduel.datasets import registry
from slamduel.datasets.rendering import _background
from slamduel.core.kernels import compile_ahead, compiled
from slamduel.frontend.markers import kernels

compile_ahead._compile(kernels.kernels())
before = compiled.ready()
source = registry.find("aruco-room")
source.make(source.options(markers=8, seconds=1.0), np.random.default_rng(0))
print(compiled.ready() - before - len(_background.meet.overloads))  # the camera's, not the detector's
"""


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A package with eight inner loops that call a ninth."""
    house = tmp_path / "house"
    house.mkdir()
    for module in (ahead, compiled):
        shutil.copy(str(module.__file__), house)
    loops = "\n".join(f"@compiled\ndef loop{k}(x):\n    return shared(x) * {k}\n" for k in range(8))
    (house / "__init__.py").touch()
    (house / "_loops.py").write_text(LOOPS.format(loops=loops))
    (house / "listed.py").write_text(LISTED)
    return house


def started(house: Path) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", ASK], cwd=house.parent, stdout=subprocess.PIPE, text=True)


def compiled_in(house: Path) -> int:
    """How often machine code was written to the disk."""
    return len(list((house / "__pycache__").glob("*.nbc")))


@pytest.mark.slow
def test_all_is_compiled_and_another_process_finds_it(house: Path) -> None:
    both = [started(house), started(house)]
    for one in both:
        said, _ = one.communicate()
        value, ready, _ = said.split()
        assert (float(value), one.returncode) == (6.0, 0)
        assert int(ready) >= 8
    assert compiled_in(house) == 9
    said, _ = started(house).communicate()
    assert said.split() == ["6.0", "1", "0"]  # nothing but what was asked for is loaded


@pytest.mark.slow
def test_one_core_compiles_what_it_calls(house: Path) -> None:
    program = f"import os; os.cpu_count = lambda: 1; {ASK}"
    done = subprocess.run([sys.executable, "-c", program], cwd=house.parent, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["6.0", "2", "2"]


@pytest.mark.slow
@pytest.mark.parametrize("program", [COVERED, IN_THE_ROOM], ids=["a smoother", "a marker detector"])
def test_nothing_is_called_that_is_not_listed(program: str) -> None:
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0"]
