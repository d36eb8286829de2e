"""Compiled inner loops are made anew when a file that they call into has changed, and only then."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import slamduel.frontend.compiled as module
from slamduel.backends import _models

OUTER = "from .compiled import compiled\nfrom ._inner import inner\n\n@compiled\ndef outer(x):\n    return inner(x)\n"
INNER = "from .compiled import compiled\n\n@compiled\ndef inner(x):\n    return x + {}\n"
ASK = (
    "from house.floor import compiled; from house.floor._outer import outer; y = outer(1.0); "
    "print(y, sum(outer.stats.cache_hits.values()), compiled.made())"
)


def test_a_changed_callee_is_noticed_and_an_unchanged_one_is_not_compiled_again(tmp_path: Path) -> None:
    floor = tmp_path / "house" / "floor"
    floor.mkdir(parents=True)
    (floor.parent / "__init__.py").touch()
    (floor / "__init__.py").touch()
    shutil.copy(module.__file__, floor / "compiled.py")
    (floor / "_outer.py").write_text(OUTER)

    def answer(added: int) -> str:
        (floor / "_inner.py").write_text(INNER.format(added))
        return subprocess.run(
            [sys.executable, "-c", ASK], cwd=tmp_path, check=True, capture_output=True, text=True
        ).stdout

    assert answer(1) == "2.0 0 2\n"
    assert answer(1) == "2.0 1 0\n"
    assert answer(2) == "3.0 0 2\n"


def test_what_is_called_for_the_first_time_is_counted() -> None:
    _models.wrap(1.0)
    before = module.ready()
    _models.wrap(2.0)
    assert module.ready() == before
    assert _models.wrap(np.float32(1.0)) == 1.0  # pyright: ignore[reportArgumentType] - another type, other code
    assert module.ready() == before + 1


def test_a_loop_in_a_file_that_the_stamp_does_not_see_is_refused() -> None:
    with pytest.raises(ValueError, match="underscore"):
        module.compiled(lambda x: x)
