"""No compiled function reads or writes beyond an array's end: all of them run on small inputs with numba's checks.

Without the checks such a write changes a neighbour's numbers, or ends the process later and elsewhere; an index below
zero would count from the end, as in Python. An offset that is wrong and still inside its array is not noticed.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from places import SUPPORT

PLANTED = """
import numpy as np
from slamduel.core.kernels._arrays import Arrays, Numbers, at
from slamduel.core.kernels.compiled import compiled

class Bundle(Arrays):
    before: Numbers
    numbers: Numbers

bundle = at(Bundle)

@compiled
def into_an_array(numbers, bundled, address):
    numbers[len(numbers)] = 1.0

@compiled
def below_zero(numbers, bundled, address):
    numbers[len(numbers) - 4] = 1.0

@compiled
def into_a_bundle(numbers, bundled, address):
    bundled.numbers[len(numbers)] = 1.0

@compiled
def at_an_address(numbers, bundled, address):
    bundle(address).numbers[len(numbers)] = 1.0
"""
PLANT = """
import sys
import numpy as np
from numba import config
import _planted

sys.path.append(sys.argv[1])
import index_checks

if config.BOUNDSCHECK:
    index_checks.begin()
for write in (_planted.into_an_array, _planted.below_zero, _planted.into_a_bundle, _planted.at_an_address):
    whole = np.zeros(4)
    bundled = _planted.Bundle(before=np.zeros(8), numbers=whole[:3])
    try:
        write(whole[:3], bundled, bundled.address)
        print("wrote", *whole)
    except IndexError as error:
        print(error)
"""
CAUGHT = "\n".join(["index is out of bounds"] * 4)
WROTE = "\n".join(["wrote 0.0 0.0 0.0 1.0", "wrote 0.0 0.0 1.0 0.0", *["wrote 0.0 0.0 0.0 1.0"] * 2])


def said(*command: object, cache: Path, checks: bool) -> str:
    """A command's output, of a process with numba's checks or without; its status is 0."""
    own = {"NUMBA_BOUNDSCHECK": str(int(checks)), "NUMBA_CACHE_DIR": str(cache), "SLAMDUEL_CACHE": str(cache / "logs")}
    words = [sys.executable, *map(str, command)]
    done = subprocess.run(words, env=os.environ | own, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-3000:]
    return done.stdout.strip()


@pytest.mark.slow
def test_no_index_is_out_of_bounds_and_every_function_was_entered(tmp_path: Path) -> None:
    assert said(SUPPORT / "bounds_drives.py", cache=tmp_path, checks=True) == ""


@pytest.mark.slow
def test_a_planted_write_is_noticed_with_the_checks_alone(tmp_path: Path) -> None:
    """In a folder per kind: numba's cache gives a process with checks the code of one without, which checks nothing."""
    (tmp_path / "_planted.py").write_text(PLANTED)
    (tmp_path / "plant.py").write_text(PLANT)
    plant, plain, checked = (tmp_path / "plant.py", SUPPORT), tmp_path / "plain", tmp_path / "checked"
    assert said(*plant, cache=checked, checks=True) == CAUGHT
    assert said(*plant, cache=plain, checks=False) == WROTE
    assert said(*plant, cache=plain, checks=True) == WROTE
