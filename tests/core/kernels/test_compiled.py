"""Compiled inner loops are made anew when a file that they call into has changed, and only then."""

import importlib
import inspect
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from numba.np.arrayobj import populate_array

import slamduel.core.kernels.compiled as module
from places import LAYERS, ROOT
from slamduel.core.kernels import _planar

FILES = {
    "floor/room/_outer.py": "from ..compiled import compiled\nfrom .._middle import middle\n",
    "floor/_middle.py": "from .compiled import compiled\nfrom ..other import _inner\n\ninner = _inner.inner\n",
    "other/_inner.py": "from ..floor.compiled import compiled\n",
    "other/_apart.py": "from ..floor.compiled import compiled\n",
}
LOOPS = {
    "floor/room/_outer.py": "def outer(x):\n    return middle(x)\n",
    "floor/_middle.py": "def middle(x):\n    return inner(x)\n",
    "other/_inner.py": "def inner(x):\n    return x + 1\n",
    "other/_apart.py": "def apart(x):\n    return x + 1\n",
}
ASK = (
    "from house.floor import compiled; from house.floor.room._outer import outer; "
    "from house.other._apart import apart; "
    "print(outer(1.0), apart(1.0), *(sum(f.stats.cache_hits.values()) for f in (outer, apart)), compiled.made())"
)

PAIR = """
from typing import NamedTuple
from ..floor.compiled import compiled

class {name}(NamedTuple):
    x: float

@compiled
def first(pair):
    return pair.x

print(first({name}(1.0)), sum(first.stats.cache_hits.values()))
"""


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A package with inner loops in three folders: `outer` calls `middle`, that calls `inner`, and `apart` none."""
    house = tmp_path / "house"
    for name, imports in FILES.items():
        (house / name).parent.mkdir(parents=True, exist_ok=True)
        (house / name).write_text(f"{imports}\n@compiled\n{LOOPS[name]}")
    for folder in (house, house / "floor", house / "floor" / "room", house / "other"):
        (folder / "__init__.py").touch()
    shutil.copy(module.__file__, house / "floor" / "compiled.py")
    return house


def answer(house: Path) -> str:
    """What `outer` and `apart` give, which of them were found on disk, and how many kernels were compiled."""
    done = subprocess.run([sys.executable, "-c", ASK], cwd=house.parent, check=True, capture_output=True, text=True)
    return done.stdout.strip()


@pytest.mark.slow
def test_a_changed_callee_is_noticed_and_what_does_not_call_it_is_not_compiled_again(house: Path) -> None:
    assert answer(house) == "2.0 2.0 0 0 4"
    assert answer(house) == "2.0 2.0 1 1 0"
    inner = house / "other" / "_inner.py"
    inner.write_text(inner.read_text().replace("x + 1", "x + 2"))
    assert answer(house) == "3.0 2.0 0 1 3"  # `inner`, `middle` and `outer`
    apart = house / "other" / "_apart.py"
    apart.write_text(apart.read_text().replace("x + 1", "x + 5"))
    assert answer(house) == "3.0 6.0 1 0 1"


@pytest.mark.slow
def test_a_copy_of_the_files_with_their_cache_compiles_nothing(house: Path, tmp_path: Path) -> None:
    """As a checkout with a cache that was kept: all files have another place and time."""
    assert answer(house) == "2.0 2.0 0 0 4"
    copy = shutil.copytree(house, tmp_path / "elsewhere" / "house", copy_function=shutil.copyfile)
    assert (copy / "other" / "_inner.py").stat().st_mtime_ns != (house / "other" / "_inner.py").stat().st_mtime_ns
    shutil.rmtree(house)
    assert answer(copy) == "2.0 2.0 1 1 0"


@pytest.mark.slow
def test_a_compiler_at_work_is_told_from_code_that_is_loaded(house: Path) -> None:
    """Asked all the time by another thread, while `outer` is first called."""
    ask = (
        "import threading; from house.floor import compiled; from house.floor.room._outer import outer\n"
        "said, over = set(), threading.Event()\n"
        "def watch():\n    while not over.wait(0.001): said.add(compiled.compiling())\n"
        "watching = threading.Thread(target=watch); watching.start()\n"
        "outer(1.0); over.set(); watching.join(); print(True in said, compiled.compiling())"
    )
    words = [sys.executable, "-c", ask]
    for at_work in (True, False):
        done = subprocess.run(words, cwd=house.parent, check=True, capture_output=True, text=True)
        assert done.stdout.split() == [str(at_work), "False"]


@pytest.mark.slow
def test_who_waits_for_the_compiler_of_another_process_is_told_so(house: Path) -> None:
    """Asked where `outer`, `middle` and `inner` each wait for their lock; what is loaded waits for nothing long."""
    ask = (
        "from house.floor import compiled; from house.floor.room._outer import outer\n"
        "lock, said = compiled.fcntl.lockf, []\n"
        "def lockf(file, kind, *rest):\n"
        "    if kind == compiled.fcntl.LOCK_EX: said.append(compiled.compiling())\n"
        "    return lock(file, kind, *rest)\n"
        "compiled.fcntl.lockf = lockf; outer(1.0); print(*said)"
    )
    words = [sys.executable, "-c", ask]
    for told in (["True"] * 3, ["False"]):
        done = subprocess.run(words, cwd=house.parent, check=True, capture_output=True, text=True)
        assert done.stdout.split() == told


def test_numba_has_the_private_parts_that_are_relied_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """`compiled` uses a dispatcher's cache file, `get_call_template` and `compile`; `_arrays` uses `populate_array`."""
    dispatcher: Any = _planar.wrap
    dispatcher(1.0)
    file = dispatcher._cache._cache_file
    assert file._source_stamp == module.stamp(Path(inspect.getfile(dispatcher.py_func)))
    assert file._load_index()
    monkeypatch.setattr(file, "_source_stamp", "of another source")
    assert not file._load_index()
    assert Path(dispatcher._cache.cache_path).is_dir()
    assert list(inspect.signature(Dispatcher.get_call_template).parameters) == ["self", "args", "kws"]
    assert list(inspect.signature(Dispatcher.compile).parameters) == ["self", "sig"]
    given = {"array", "data", "shape", "strides", "itemsize", "meminfo"}
    assert given <= set(inspect.signature(populate_array).parameters)


@pytest.mark.slow
def test_an_index_that_is_damaged_or_names_a_type_that_is_gone_is_as_good_as_none(house: Path) -> None:
    def said(name: str) -> str:
        (house / "other" / "_pair.py").write_text(PAIR.format(name=name))
        ask = [sys.executable, "-c", "import house.other._pair"]
        return subprocess.run(ask, cwd=house.parent, check=True, capture_output=True, text=True).stdout

    assert [said("Pair"), said("Pair"), said("Couple")] == ["1.0 0\n", "1.0 1\n", "1.0 0\n"]
    (index,) = (house / "other" / "__pycache__").glob("_pair.first-*.nbi")
    index.write_bytes(index.read_bytes()[:-20])
    assert [said("Couple"), said("Couple")] == ["1.0 0\n", "1.0 1\n"]


@pytest.mark.parametrize("edited", FILES)
def test_an_edit_changes_the_stamps_of_what_imports_the_file(house: Path, edited: str) -> None:
    def stamps() -> list[str]:
        module.stamp.cache_clear()
        return [module.stamp(house / name) for name in FILES]

    before = stamps()
    (house / edited).write_text((house / edited).read_text() + "\n# edited\n")
    callers = list(FILES)[: list(FILES).index(edited) + 1] if "_apart" not in edited else [edited]
    assert [name for name, old, new in zip(FILES, before, stamps(), strict=True) if old != new] == callers


def test_every_loop_that_a_loop_calls_counts_for_its_stamp() -> None:
    """By what the names in a loop stand for, however these came into its file."""
    files = [file for layer in LAYERS for file in (ROOT / layer).rglob("_*.py")]
    files = [file for file in files if "import compiled" in file.read_text()]
    assert len(files) > 10
    for file in files:
        name = ".".join(["slamduel", *file.relative_to(ROOT).with_suffix("").parts])
        known: dict[str, Any] = vars(importlib.import_module(name))
        loops = {name: each.py_func.__code__ for name, each in known.items() if hasattr(each, "py_func")}
        called = {Path(loops[name].co_filename) for loop in loops.values() for name in loop.co_names if name in loops}
        assert called <= module.closure(file), name


def test_what_is_called_for_the_first_time_is_counted() -> None:
    _planar.wrap(1.0)
    before = module.ready()
    _planar.wrap(2.0)
    assert module.ready() == before
    assert _planar.wrap(np.float32(1.0)) == 1.0  # pyright: ignore[reportArgumentType] - another type, other code
    assert module.ready() == before + 1


def test_a_loop_in_a_file_that_the_stamp_does_not_see_is_refused() -> None:
    with pytest.raises(ValueError, match="underscore"):
        module.compiled(lambda x: x)
