"""Keys of a study's store: a change of code re-runs what it touches, and nothing else."""

import json
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from places import ROOT
from slamduel.bench.engine import key as study_key
from slamduel.bench.engine.key import ELSEWHERE, JUDGE, backend_key, from_files, log_key, result_key, source_key
from slamduel.bench.plan.plan import Cell
from slamduel.bench.plan.spec import backend_variants, dataset_variants
from slamduel.bench.plan.variant import DatasetVariant, OneLog
from slamduel.bench.record import fingerprint as code
from slamduel.bench.record import library_version
from slamduel.bench.record.fingerprint import closure, fingerprint, imports, source
from slamduel.bench.record.store import Known
from slamduel.datasets import registry as datasets
from slamduel.datasets.registry import Source

LOG = Known("d", "t", "truth")

READ = code.read


def forget() -> None:
    """What is known of files so far."""
    libraries = (library_version.located, library_version.is_library)
    for cached in (source_key, backend_key, fingerprint, READ, source, code.folder_of, *libraries):
        cached.cache_clear()


@pytest.fixture(autouse=True)
def anew() -> Iterator[None]:
    yield
    forget()


@pytest.fixture
def edited(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let files of the package read as if each had one more line; with none, as they are."""

    def edit(*names: str) -> None:
        changed = {ROOT / name for name in names}
        assert all(path.is_file() for path in changed)
        monkeypatch.setattr(code, "read", lambda path: path.read_bytes() + b"\n# edited\n" * (path in changed))
        for cached in (source_key, backend_key, fingerprint):
            cached.cache_clear()

    return edit


def cell(dataset: str = "circle", backend: str = "ekf", seed: int = 0) -> Cell:
    return Cell(dataset_variants(dataset)[0], backend_variants(backend)[0], seed)


BACKENDS = {"dead-reckoning", "ekf", "ukf", "isam2", "graph", "fastslam"}
LOGS = {"circle", "matlab-report", "victoria-park"}


def keys() -> dict[str, str]:
    """Of some logs, and of results of some backends."""
    found = {name: log_key(cell(name).log) for name in LOGS}
    return found | {name: result_key(cell(backend=name), LOG, timed=False, oracle=False) for name in BACKENDS}


@pytest.mark.parametrize(
    ("files", "touched"),
    [
        ("backends/unscented/ukf.py", {"ukf"}),
        ("backends/unscented/_transform.py", {"ukf"}),
        ("backends/gaussian/joint.py", {"ekf", "ukf"}),
        ("backends/particles/fastslam.py", {"fastslam"}),
        ("backends/graphs/isam2.py", {"isam2", "graph"}),
        ("backends/graphs/graph.py", {"graph"}),
        ("backends/graphs/gauss_newton.py backends/smoothing/_front.py", BACKENDS),  # scores ask if J is the least
        ("backends/api.py", BACKENDS),
        ("datasets/worlds/circle.py", {"circle"}),
        ("datasets/published/victoria_park.py", {"victoria-park"}),
        ("datasets/cache.py", LOGS),
        ("core/se2.py", LOGS | BACKENDS),
        ("bench/measure/drive.py", BACKENDS),
        ("bench/measure/score.py", BACKENDS),
        ("bench/measure/nees.py", BACKENDS),
        ("bench/report/figures.py bench/report/report.py bench/drawing/page.py bench/record/store.py", set()),
        ("bench/drawing/templates/report.html.jinja bench/verdict/verdict.py bench/study/file.py bench/cli.py", set()),
        ("bench/study/studies/matlab-report.toml", set()),
        ("datasets/registry.py backends/registry.py __init__.py", set()),
    ],
)
def test_an_edit_changes_the_keys_of_what_it_touches(
    edited: Callable[..., None], files: str, touched: set[str]
) -> None:
    edited()
    before = keys()
    edited(*files.split())
    after = keys()
    assert {name for name in before if before[name] != after[name]} == touched


def test_a_cell_is_judged_by_no_report() -> None:
    files, libraries = closure(JUDGE, ELSEWHERE)
    names = {name.removeprefix("slamduel.") for name in files}
    assert {
        *(f"bench.measure.{name}" for name in ["cell", "drive", "score", "misfit", "nees"]),
        "core.factors",
    } <= names
    assert {name for name in names if name.startswith("datasets.")} == set()
    assert not libraries & {"matplotlib", "jinja2", "rich", "gtsam", "cv2"}
    assert {name.split(".")[1] for name in names if name.startswith("bench.")} == {"bound", "measure", "process"}
    others = ("report", "plot", "page", "figure", "store", "runner", "summary", "record", "words", "core.table")
    assert not any(word in name for name in names for word in others)


def test_every_module_that_a_backend_loads_is_in_its_closure() -> None:
    """Against the interpreter: what importing them has loaded in this process, each reached from its own module."""
    families = {
        "gaussian": ("ekf",), "unscented": ("ukf",), "graphs": ("isam2", "fixed_lag"), "invariant": ("invariant_ekf",),
        "particles": ("fastslam",), "window": ("fixed_lag",),
    }  # fmt: skip
    for name in (f"{family}.{name}" for family, names in families.items() for name in names):
        __import__(f"slamduel.backends.{name}")
        files, libraries = closure(f"slamduel.backends.{name}")
        module = sys.modules[f"slamduel.backends.{name}"]
        used = {getattr(value, "__module__", None) or "" for value in vars(module).values()}
        assert {other for other in used if other.startswith("slamduel.")} <= set(files)
        assert "numpy" in libraries
    assert "scipy" in closure("slamduel.backends.gaussian.ekf")[1]  # which only a literal in a call names


def test_a_log_that_is_read_from_files_is_looked_at_anew() -> None:
    for name in datasets.BUILTIN:
        found: Source = datasets.find(name)
        reads = any(field.name == "path" for field in fields(found.options))
        assert not reads or from_files(OneLog(DatasetVariant(name, found.options(), found), 0)), name
    assert from_files(cell("victoria-park").log)
    assert not from_files(cell("circle").log)


def test_each_thing_that_determines_a_result_is_in_its_key() -> None:
    plain = cell()

    def key(found: Cell = plain, log: Known = LOG, *, timed: bool = False, oracle: bool = False) -> str:
        return result_key(found, log, timed=timed, oracle=oracle)

    drawn, third = cell(backend="fastslam"), 0.1 + 0.2
    gated = [cell(backend=f"ekf[gate={gate!r}]") for gate in (0.3, third)]
    others = [
        key(), key(timed=True), key(oracle=True), key(log=LOG._replace(digest="e")), key(drawn),
        key(log=LOG._replace(truth_digest="u")), key(log=LOG._replace(truth_kind="reference")),
        key(replace(drawn, seed=1)), *(key(found) for found in gated),
    ]  # fmt: skip
    assert len(set(others)) == len(others)
    assert key(replace(cell(), seed=5)) == key()  # it draws nothing: the log's digest tells seeds apart
    assert log_key(replace(cell(), seed=5).log) != log_key(cell().log)
    assert log_key(cell("victoria-park", seed=5).log) == log_key(cell("victoria-park").log)
    assert log_key(cell("circle[steps=30]").log) != log_key(cell("circle").log)
    assert log_key(cell("circle[steps=30]").log) == log_key(cell("circle[steps=30]", "ukf").log)


def test_numbers_stand_in_a_key_to_the_last_bit() -> None:
    hashed = study_key.hashed
    for value in (0.1, 1e300, 5e-324, 1 / 3):
        assert hashed(value) != hashed(math.nextafter(value, 1.0))
        assert json.loads(json.dumps(value)) == value
    assert hashed(np.float64(0.1)) == hashed(0.1)


def test_imports_are_found_wherever_they_stand() -> None:
    found = imports(
        b"import os.path as path\n"
        b"from typing import TYPE_CHECKING\n"
        b"if TYPE_CHECKING:\n    from . import never\nelse:\n    from . import always\n"
        b"class A:\n    def f(self):\n        try:\n            from ..x import y, z\n"
        b"        except ImportError:\n            import w\n"
        b"        with open('table.csv'):\n            return import_module('.lazy', __package__)\n"
        b"TABLE = {'a': '.not_followed:build'}\n"
    )
    assert dict(found.modules) == {
        "os.path": (), "typing": ("TYPE_CHECKING",), ".": ("always",), "..x": ("y", "z"), "w": (),
    }  # fmt: skip
    assert ".lazy" in found.called
    assert not any("followed" in name for name in found.called)
    assert "table.csv" in found.texts


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def test_a_plug_in_has_all_its_code_in_its_fingerprint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    write(
        tmp_path,
        {
            "own_slam/__init__.py": "",
            "own_slam/backend.py": "from .deep.maths import f\nfrom slamduel.backends import models\nimport own_aside\n"
            "def build():\n    from . import late\n    return open('table.csv'), 'weights'",
            "own_slam/late.py": "import scipy.linalg, no_such_library",
            "own_slam/unused.py": "",
            "own_slam/table.csv": "1",
            "own_slam/other.csv": "1",
            "own_slam/weights/a.bin": "1",
            "own_slam/deep/__init__.py": "",
            "own_slam/deep/maths.py": "from own_slam import sibling as s\nf = s",
            "own_slam/sibling.py": "from . import backend",
            "own_aside.py": "import numpy",
        },
    )
    files, libraries = closure("own_slam.backend")
    mine = {path.relative_to(tmp_path).as_posix() for path in files.values() if path.is_relative_to(tmp_path)}
    unused = {"own_slam/unused.py", "own_slam/other.csv"}
    everything = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert mine == {name for name in everything if "__pycache__" not in name} - unused
    assert {"scipy", "numpy"} <= libraries
    assert "slamduel.backends.models" in files
    assert "own_slam" not in sys.modules  # its code is read, and does not run

    before = fingerprint("own_slam.backend")
    for name in sorted(mine | unused):
        kept = (tmp_path / name).read_text()
        (tmp_path / name).write_text(f"{kept}\n")
        forget()
        assert (fingerprint("own_slam.backend") == before) == (name in unused), name
        (tmp_path / name).write_text(kept)


def test_code_that_is_no_python_or_is_not_there_has_a_fingerprint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    write(tmp_path, {"broken_slam.py": "def f(:"})
    assert fingerprint("broken_slam") != fingerprint("absent_slam")
    write(tmp_path, {"absent_slam.py": ""})
    before = fingerprint("absent_slam")
    forget()
    assert fingerprint("absent_slam") != before


def test_a_library_counts_by_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, distribution in (("numpy", "numpy"), ("cv2", "opencv-contrib-python-headless"), ("gtsam", "gtsam")):
        assert library_version.version(name) == f"{distribution}-{metadata.version(distribution)}"
    assert not library_version.is_library("json")
    assert not library_version.is_library("no_such_library")
    before = keys()
    forget()
    version = library_version.version
    monkeypatch.setattr(code, "version", lambda name: version(name) + "1" * (name == "gtsam"))
    after = keys()
    assert {name for name in before if before[name] != after[name]} == {"isam2", "graph", "victoria-park"}


@dataclass(frozen=True)
class Odd:
    """Options of somebody's own."""

    path: Path = Path("here")
    sizes: tuple[int, ...] = (1, 2)


def test_options_of_any_kind_have_a_key() -> None:
    found: Any = replace(cell().backend, options=Odd())
    other: Any = replace(cell().backend, options=Odd(Path("there")))
    assert len({result_key(Cell(cell().dataset, b, 0), LOG, timed=False, oracle=False) for b in (found, other)}) == 2
