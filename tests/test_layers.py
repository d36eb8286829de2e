"""An import only ever goes down: bench, then datasets and backends, which never see each other, then frontend."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
BELOW: dict[str, set[str]] = {
    "frontend": set(),
    "backends": {"frontend"},
    "datasets": {"frontend"},
    "bench": {"frontend", "backends", "datasets"},
}
HEAVY = {"gtsam", "cv2", "evo", "matplotlib", "rich", "jinja2", "scipy", "numba"}


class Import(NamedTuple):
    """One module that a file imports."""

    line: int
    module: str  # dotted; of ours, from the package's root: ".backends.api"
    at_once: bool  # when the file is loaded, not when a function in it is called


def imports(file: Path, root: Path) -> Iterator[Import]:
    """Every import of a file, wherever it stands."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    folder = list(file.relative_to(root).parts[:-1])
    later = {id(inner) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef | ast.Lambda) for inner in ast.walk(f)}
    later |= {
        id(inner)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.dump(block.test)
        for statement in block.body
        for inner in ast.walk(statement)
    }
    for node in ast.walk(tree):
        at_once = id(node) not in later
        if isinstance(node, ast.Import):
            yield from (Import(node.lineno, name.name, at_once) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield Import(node.lineno, node.module or "", at_once)
        elif isinstance(node, ast.ImportFrom):
            up = node.level - 1
            if up > len(folder):
                yield Import(node.lineno, "..", at_once)
                continue
            start = folder[: len(folder) - up] + (node.module.split(".") if node.module else [])
            # `from . import x` may name a module as well as something in one: both are looked at
            yield from (Import(node.lineno, "." + ".".join([*start, name.name]), at_once) for name in node.names)


def files(root: Path) -> list[Path]:
    return sorted(f for f in root.rglob("*.py") if f.relative_to(root).parts[0] in (*BELOW, "__init__.py"))


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
            todo += [place.with_suffix(".py"), place / "__init__.py", place.parent.with_suffix(".py")]
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


def test_the_command_line_loads_nothing_heavy() -> None:
    start = ROOT / "bench" / "cli.py"
    if not start.is_file():
        pytest.skip("there is no bench/cli.py")
    assert weighing(start, ROOT) == []
    code = f"import sys, slamduel.bench.cli; print(*sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=os.path.sep)
    assert done.stdout.strip() == ""


def test_backends_and_datasets_are_named_without_being_loaded() -> None:
    code = (
        "import sys, slamduel.backends.registry, slamduel.datasets.registry, slamduel.backends.api; "
        f"print(*sorted({HEAVY!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=os.path.sep)
    assert done.stdout.strip() == ""


PLANTED = {
    "from ..bench.cli import main": "up",
    "from ..datasets import registry": "sideways",
    "from .. import datasets": "sideways",
    "def f():\n    from ..bench import cli": "up, in a function",
    "from ... import other": "out of the package",
    "import slamduel.frontend.se2": "by its own name",
    "from slamduel.frontend import se2": "by its own name",
    "from datasets import load_dataset": "as if it were installed by that name",
}


@pytest.fixture
def house(tmp_path: Path) -> Path:
    for name in BELOW:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / "__init__.py").write_text("")
    (tmp_path / "frontend" / "se2.py").write_text("import numpy as np\n")
    (tmp_path / "backends" / "api.py").write_text("from ..frontend.se2 import np\nfrom . import ekf\n")
    (tmp_path / "backends" / "ekf.py").write_text("from ..frontend import se2\n")
    (tmp_path / "bench" / "cli.py").write_text("from ..backends import api\nfrom ..datasets import registry\n")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_x.py").write_text("import slamduel\n")
    return tmp_path


@pytest.mark.parametrize("planted", PLANTED, ids=PLANTED.get)
def test_the_walker_sees_an_import_that_climbs(house: Path, planted: str) -> None:
    assert climbing(house) == []
    (house / "backends" / "ekf.py").write_text(planted + "\n")
    (found,) = climbing(house)
    assert found.startswith(os.path.join("backends", "ekf.py:"))


def test_the_walker_sees_a_frontend_that_looks_up(house: Path) -> None:
    (house / "frontend" / "se2.py").write_text("from ..backends import api\n")
    assert climbing(house) == [os.path.join("frontend", "se2.py:1") + " .backends.api"]


@pytest.mark.parametrize("planted", ["import scipy.stats", "from evo import core", "if True:\n    import gtsam"])
def test_the_walker_sees_what_weighs(house: Path, planted: str) -> None:
    cli = house / "bench" / "cli.py"
    assert weighing(cli, house) == []
    (house / "backends" / "ekf.py").write_text(planted + "\n")
    assert len(weighing(cli, house)) == 1
    (house / "backends" / "ekf.py").write_text("def f():\n    " + planted.replace("\n", "\n    ") + "\n")
    assert weighing(cli, house) == []
