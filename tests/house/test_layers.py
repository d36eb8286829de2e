"""An import only ever goes down.

The layers are bench, then datasets and backends, which never see each other, then frontend, which backends do not see,
then core. A layer has rooms, and a room sees those that `ROOMS` allows it.
"""

import ast
import functools
import graphlib
import itertools
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from places import ROOT

BELOW: dict[str, set[str]] = {
    "core": set(),
    "frontend": {"core"},
    "backends": {"core"},
    "datasets": {"core", "frontend"},
    "bench": {"core", "frontend", "backends", "datasets"},
}

TOP = "."
"""The files of a layer that are in none of its rooms."""

ROOMS: dict[str, dict[str, set[str]]] = {
    "core": {TOP: set(), "factors": {TOP}, "toml": {TOP}, "kernels": {TOP}, "truth": {TOP, "factors"}},
    "frontend": {
        TOP: set(),
        "wheels": {TOP},
        "inertial": {TOP, "wheels"},
        "camera": {TOP},
        "markers": {TOP, "wheels", "inertial", "camera"},
        "boards": {TOP, "camera", "markers"},
        "maps": {TOP, "camera"},
        "laser": {TOP, "inertial", "maps"},
        "several": {TOP, "wheels", "inertial", "markers", "laser", "depth"},
        "world": {TOP, "wheels", "inertial"},
        "depth": {TOP, "wheels", "inertial", "camera", "maps"},
    },
    "backends": {
        TOP: set(),
        "locating": {TOP},
        "association": {TOP, "locating"},
        "biases": {TOP},
        "starting": {TOP},
        "gaussian": {TOP, "starting"},
        "invariant": {TOP, "gaussian"},
        "unscented": {TOP, "gaussian"},
        "particles": {TOP, "locating", "starting"},
        "smoothing": {TOP},
        "incremental": {TOP, "smoothing", "starting"},
        "keeping": {TOP, "smoothing", "incremental"},
        "window": {TOP, "smoothing", "incremental"},
        "graphs": {TOP, "smoothing", "incremental", "window", "starting"},
        "programs": {TOP},
    },
    "datasets": {
        TOP: set(),
        "rendering": {TOP, "on_demand"},
        "on_demand": {TOP},
        "worlds": {TOP, "rendering", "on_demand"},
        "formats": {TOP},
        "tables": {TOP, "formats", "fixes", "inertial"},
        "noise": {TOP},
        "own_worlds": {TOP, "worlds", "formats", "on_demand"},
        "patrol": {TOP, "worlds", "rendering", "on_demand"},
        "graphs": {TOP, "formats"},
        "published": {TOP, "on_demand", "formats", "graphs", "bags", "depth", "noise"},
        "beacons": {TOP, "formats", "graphs", "noise"},
        "bags": {TOP},
        "inertial": {TOP, "bags"},
        "fixes": {TOP, "bags"},
        "scans": {TOP, "bags", "formats", "fixes", "inertial"},
        "depth": {TOP, "bags", "fixes", "inertial"},
        "tags": {TOP, "graphs", "bags", "formats"},
        "recordings": {TOP, "bags", "scans", "depth", "tags", "fixes", "inertial"},
    },
    "bench": {
        "words": set(),
        "process": set(),
        "bound": set(),
        "measure": {"bound", "process"},
        "systematic": {"measure", "words"},
        "contradiction": {"systematic", "measure", "words"},
        "record": {"measure", "words"},
        "plan": {"words", "measure", "record"},
        "verdict": {"words", "measure", "record"},
        "drawing": {"words"},
        "workers": {"bound", "contradiction", "measure", "plan", "record"},
        "report": {"drawing", "verdict", "record", "measure", "words"},
        "engine": {"workers", "plan", "record", "measure", "words"},
        "run": {"engine", "report", "workers", "verdict", "drawing", "plan", "record", "measure", "words"},
        "check": {"workers", "plan", "measure", "words"},
        "logs": {"contradiction", "systematic", "drawing", "plan", "measure", "words"},
        "noise": {"systematic", "drawing", "plan", "measure", "words"},
        "camera": {"drawing", "words"},
        "detect": {"contradiction", "drawing", "measure", "systematic", "words"},
        "replay": {"engine", "workers", "plan", "record", "measure", "drawing", "words"},
        "verify": {"engine", "workers", "verdict", "plan", "record", "measure", "words"},
        "suite": {
            "verify", "run", "engine", "report", "workers", "verdict", "drawing", "plan", "record", "measure", "words",
        },
        "speed": {"workers", "plan", "measure", "process", "drawing", "words"},
        "front_ends": {"drawing", "words"},
        "study": {"engine", "workers", "plan", "record", "measure", "words"},
        "claims": {"study", "verdict", "record", "measure", "words"},
        "study_report": {"claims", "study", "run", "engine", "workers", "verdict", "drawing", "record", "words"},
        "commands": {
            "words", "measure", "contradiction", "record", "plan", "verdict", "drawing", "workers", "report", "run",
            "check", "logs", "noise", "camera", "detect", "replay", "speed", "front_ends", "engine", "study", "claims",
            "systematic", "study_report", "verify", "suite",
        },
        TOP: {"words"},  # cli.py loads one command, by its name
    },
}  # fmt: skip
"""Layer -> room -> the rooms of that layer that it may import from, beside itself."""

BLOCKS = ("body", "handlers", "cases", "orelse", "finalbody")
TOPS = (*BELOW, "__init__.py", "__main__.py")

MOST = 20
"""Modules in one folder."""

HEAVY = {"gtsam", "cv2", "evo", "matplotlib", "rich", "jinja2", "scipy", "numba", "pooch"}


class Import(NamedTuple):
    """One module that a file imports."""

    line: int
    module: str  # dotted; of ours, from the package's root: ".backends.api"
    at_once: bool  # when the file is loaded, not when a function in it is called


def imports(file: Path, root: Path) -> list[Import]:
    """Every import of a file, wherever it stands."""
    return stated(file.read_text(encoding="utf-8"), file.relative_to(root).parts[:-1])


@functools.cache
def stated(source: str, folder: tuple[str, ...]) -> list[Import]:
    """The imports in a source that lies in `folder`."""
    return list(_stated(ast.parse(source), list(folder), True))


def _stated(block: ast.AST, folder: list[str], at_once: bool) -> Iterator[Import]:
    """Those in a block and in the statements of its statements; expressions, which are most of a file, have none."""
    inside = at_once and not isinstance(block, ast.FunctionDef | ast.AsyncFunctionDef)
    for node in itertools.chain.from_iterable(getattr(block, name, []) for name in BLOCKS):
        if isinstance(node, ast.Import):
            yield from (Import(node.lineno, name.name, inside) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield Import(node.lineno, node.module or "", inside)
        elif isinstance(node, ast.ImportFrom):
            up = node.level - 1
            if up > len(folder):
                yield Import(node.lineno, "..", inside)
                continue
            start = folder[: len(folder) - up] + (node.module.split(".") if node.module else [])
            # `from . import x` may name a module as well as something in one: both are looked at
            yield from (Import(node.lineno, "." + ".".join([*start, name.name]), inside) for name in node.names)
        elif not isinstance(node, ast.expr):  # the body of a lambda or of a conditional expression is one
            checking = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            yield from _stated(node, folder, inside and not checking)


def files(root: Path) -> list[Path]:
    return sorted(f for f in root.rglob("*.py") if f.relative_to(root).parts[0] in TOPS)


def climbing(root: Path) -> list[str]:
    """Every import that goes up, sideways or out of the package, or names it outright, as `file:line module`."""
    found: list[str] = []
    for file in files(root):
        layer = file.relative_to(root).parts[0]
        allowed = BELOW.get(layer, set(BELOW)) | {layer}  # the package itself names things of every floor
        for line, module, _ in imports(file, root):
            ours = module.startswith(".")
            target = module.split(".")[1] if ours else module.split(".")[0]
            if (ours and target not in allowed) or (not ours and target in {"slamduel", *BELOW}):
                found.append(f"{file.relative_to(root)}:{line} {module}")
    return found


def room_of(parts: list[str], root: Path) -> str:
    """The room that a path, or a dotted name, of a layer is in; `parts` begins with the layer."""
    return parts[1] if len(parts) > 1 and root.joinpath(*parts[:2]).is_dir() else TOP


def straying(root: Path) -> list[str]:
    """Every import from a room of the same layer that `ROOMS` does not allow, as `file:line module`."""
    found: list[str] = []
    for file in files(root):
        layer, *rest = file.relative_to(root).parts
        if not rest:
            continue
        room = room_of([layer, *rest], root)
        allowed = ROOMS[layer].get(room, set()) | {room}
        for line, module, _ in imports(file, root):
            target = module.removeprefix(".").split(".")
            inside = module.startswith(".") and target[0] == layer and len(target) > 1
            if inside and room_of(target, root) not in allowed:
                found.append(f"{file.relative_to(root)}:{line} {module}")
    return found


def module_of(name: str, root: Path) -> Path | None:
    """The file of a module of ours, or of the module that has something of that name."""
    place = root.joinpath(*name.removeprefix(".").split("."))
    places = (
        place.with_suffix(".py"), place / "__init__.py", place.parent.with_suffix(".py"), place.parent / "__init__.py"
    )  # fmt: skip
    return next((file for file in places if file.is_file()), None)


def circle(root: Path) -> list[str]:
    """Modules that import one another in a circle when they are loaded; none where there is no circle."""
    graph = {
        file: {
            target
            for found in imports(file, root)
            if found.at_once and found.module.startswith(".")
            for target in [module_of(found.module, root)]
            if target is not None
        }
        for file in files(root)
        if file.parent != root  # the package itself names things of every floor, and loads none
    }
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return [str(file.relative_to(root)) for file in error.args[1]]
    return []


def crowded(root: Path) -> list[str]:
    """Folders with more modules than one can keep in mind, as `folder: count`."""
    folders = {file.parent for file in files(root)}
    counts = {folder: len([file for file in folder.glob("*.py") if file.stem != "__init__"]) for folder in folders}
    return [f"{folder.relative_to(root)}: {count}" for folder, count in sorted(counts.items()) if count > MOST]


def loaded_by(start: Path, root: Path) -> dict[Path, list[Import]]:
    """The files that importing `start` loads, itself among them, and what each imports at once."""
    todo, loaded = [start], dict[Path, list[Import]]()
    while todo:
        file = todo.pop()
        if file in loaded or not file.is_file():
            continue
        loaded[file] = [found for found in imports(file, root) if found.at_once]
        for found in loaded[file]:
            if not found.module.startswith("."):
                continue
            place = root.joinpath(*found.module[1:].split("."))
            todo += [place.with_suffix(".py"), place / "__init__.py"]
            todo += [place.parent.with_suffix(".py"), place.parent / "__init__.py"]
    return loaded


def weighing(start: Path, root: Path) -> list[str]:
    """Every heavy package that importing `start` would load, as `file:line module`."""
    return [
        f"{file.relative_to(root)}:{found.line} {found.module}"
        for file, at_once in loaded_by(start, root).items()
        for found in at_once
        if found.module.split(".")[0] in HEAVY
    ]


def test_imports_only_go_down() -> None:
    assert len(files(ROOT)) > 10
    assert climbing(ROOT) == []


def test_rooms_see_only_those_that_they_may() -> None:
    assert straying(ROOT) == []


@pytest.mark.parametrize("layer", BELOW)
def test_every_room_is_in_the_table_and_no_other(layer: str) -> None:
    there = {room_of(list(file.relative_to(ROOT).parts), ROOT) for file in files(ROOT) if ROOT / layer in file.parents}
    assert there == set(ROOMS[layer])


def test_the_table_has_floors() -> None:
    """No room sees one that sees it, at whatever distance."""
    for rooms in ROOMS.values():
        graphlib.TopologicalSorter(rooms).prepare()


def test_contributing_has_every_room_on_a_floor_above_those_that_it_sees() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    plan = re.findall(r"^\| `?(\w+)`? \| `(\w+)` \| \S", text, re.MULTILINE)
    shown = {("bench" if place.isdigit() else place, room) for place, room in plan}
    assert shown == {(layer, room) for layer in BELOW for room in ROOMS[layer] if room != TOP}
    floors = {room: int(place) for place, room in plan if place.isdigit()}
    for room, floor in floors.items():
        assert all(floors[seen] < floor for seen in ROOMS["bench"][room]), room


def test_no_modules_load_one_another_in_a_circle() -> None:
    assert circle(ROOT) == []


def test_no_folder_is_crowded() -> None:
    assert crowded(ROOT) == []


LIGHT = ("bench.cli", "backends.registry, slamduel.datasets.registry, slamduel.backends.api")


@pytest.mark.parametrize("modules", LIGHT)
def test_the_command_line_and_the_names_of_backends_and_datasets_load_nothing_heavy(modules: str) -> None:
    assert weighing(ROOT / "bench" / "cli.py", ROOT) == []
    code = f"import sys, slamduel.{modules}; print(*sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=os.path.sep)
    assert done.stdout.strip() == ""


PLANTED = {
    "from ..bench.cli import main": "up",
    "from ..datasets import registry": "sideways",
    "from .. import datasets": "sideways",
    "def f():\n    from ..bench import cli": "up, in a function",
    "from ... import other": "out of the package",
    "from ..frontend.laser import step": "sideways, into perception",
    "import slamduel.core.se2": "by its own name",
    "from slamduel.core import se2": "by its own name",
    "from datasets import load_dataset": "as if it were installed by that name",
}
LOOKING_UP = [
    *(("core/se2.py", f"from ..{above} import api") for above in ("frontend", "backends", "datasets", "bench")),
    ("frontend/wheels.py", "from ..datasets import registry"),
]


@pytest.fixture
def house(tmp_path: Path) -> Path:
    for name in BELOW:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / "__init__.py").write_text("")
    (tmp_path / "core" / "se2.py").write_text("import numpy as np\n")
    (tmp_path / "backends" / "api.py").write_text("from ..core.se2 import np\nfrom . import ekf\n")
    (tmp_path / "backends" / "ekf.py").write_text("from ..core import se2\n")
    (tmp_path / "bench" / "cli.py").write_text("from ..backends import api\nfrom ..datasets import registry\n")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_x.py").write_text("import slamduel\n")
    return tmp_path


@pytest.mark.parametrize(("file", "planted"), [*(("backends/ekf.py", text) for text in PLANTED), *LOOKING_UP])
def test_the_walker_sees_an_import_that_climbs(house: Path, file: str, planted: str) -> None:
    assert climbing(house) == []
    (house / file).write_text(f"from ..core import se2\n{planted}\n")
    (found,) = climbing(house)
    assert found.startswith(os.path.join(*file.split("/")) + ":")


@pytest.mark.parametrize("planted", ["import scipy.stats", "from evo import core", "if True:\n    import gtsam"])
def test_the_walker_sees_what_weighs(house: Path, planted: str) -> None:
    cli = house / "bench" / "cli.py"
    assert weighing(cli, house) == []
    (house / "backends" / "ekf.py").write_text(planted + "\n")
    assert len(weighing(cli, house)) == 1
    (house / "backends" / "ekf.py").write_text("def f():\n    " + planted.replace("\n", "\n    ") + "\n")
    assert weighing(cli, house) == []


@pytest.mark.parametrize("planted", ["from ..run import runner", "def f():\n    from ..run.runner import run"])
def test_the_walker_sees_a_room_that_looks_up(house: Path, planted: str) -> None:
    for room in ("measure", "run"):
        (house / "bench" / room).mkdir()
        (house / "bench" / room / "__init__.py").write_text("")
    (house / "bench" / "run" / "runner.py").write_text("from ..measure.cell import run\nfrom ..measure import cell\n")
    (house / "bench" / "measure" / "cell.py").write_text("from . import clock\nfrom ...core.se2 import np\n")
    assert straying(house) == []
    (house / "bench" / "measure" / "clock.py").write_text(planted + "\n")
    (found,) = straying(house)
    assert found.startswith(os.path.join("bench", "measure", "clock.py:"))


def test_the_walker_sees_a_room_that_looks_aside_and_a_top_that_looks_into_one(house: Path) -> None:
    for room in ("gaussian", "graphs"):
        (house / "backends" / room).mkdir()
    (house / "backends" / "graphs" / "isam2.py").write_text("from .. import api\n")
    (house / "backends" / "gaussian" / "ekf.py").write_text("from ..graphs import isam2\n")
    (house / "backends" / "api.py").write_text("from .graphs.isam2 import api\n")
    aside, below = straying(house)
    assert aside == os.path.join("backends", "api.py:1") + " .backends.graphs.isam2.api"
    assert below == os.path.join("backends", "gaussian", "ekf.py:1") + " .backends.graphs.isam2"


def test_a_room_that_is_in_no_table_may_see_none(house: Path) -> None:
    (house / "bench" / "attic").mkdir()
    (house / "bench" / "attic" / "box.py").write_text("from .. import cli\n")
    assert straying(house) == [os.path.join("bench", "attic", "box.py:1") + " .bench.cli"]


@pytest.mark.parametrize("planted", ["from . import api", "from .api import Builder"])
def test_the_walker_sees_a_circle(house: Path, planted: str) -> None:
    assert circle(house) == []
    (house / "backends" / "ekf.py").write_text("def f():\n    " + planted + "\n")
    assert circle(house) == []
    (house / "backends" / "ekf.py").write_text(planted + "\n")
    assert set(circle(house)) == {os.path.join("backends", "api.py"), os.path.join("backends", "ekf.py")}


def test_the_walker_sees_a_crowd(house: Path) -> None:
    for k in range(MOST - 2):
        (house / "backends" / f"filter_{k}.py").write_text("")
    assert crowded(house) == []
    (house / "backends" / "one_more.py").write_text("")
    assert crowded(house) == [f"backends: {MOST + 1}"]
