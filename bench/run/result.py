"""The results of a run's folder, for Python and for notebooks: `slamduel.run`."""

import base64
import contextlib
import re
import shutil
import tempfile
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...datasets import truth as truths
from ...datasets.formats import log_folder
from ...frontend.errors import InputError
from ...frontend.factors import Dataset, Log, Truth
from ...frontend.se2 import Array
from ..drawing.page import rendered
from ..plan.spec import backend_variants, dataset_at, dataset_variants
from ..plan.values import as_whole
from ..record.store import Store
from ..report.section import sections
from ..verdict.summary import lines
from ..verdict.verdict import Verdict
from ..words.console import screen_console
from ..workers.local_executor import Local
from .benchmark import begun, benchmark, planned
from .progress import Screen
from .runner import LOGS
from .terminal import conclude, verdicts

ASKER = "slamduel.run"  # who refuses arguments, in messages
LONGEST = 60  # letters of a log's name in its folder's: no file system takes more than 255 bytes
Named = str | Path | Log | Dataset  # on the command line or as a path, or a log in memory


class Result:
    """A run's folder: its cells, verdicts and paths, which a notebook shows with its tables.

    `found.table` is a pandas frame with one row per cell; `found.verdict["aruco-room"].uses` names the backend to use
    on that dataset, and why. The folder of a study can be read in the same way.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)

    @property
    def cells(self) -> list[dict[str, Any]]:
        """Returns one dictionary per cell, by column of cells.csv; None where there is no value."""
        with Store(self.folder) as store:
            return [dict(row.columns) for row in store.cells()]

    @property
    def table(self) -> Any:
        """Returns the cells as a pandas frame, one row each; InputError where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise InputError("Result.table: expected pandas to be installed; Result.cells is without.") from None
        return pandas.DataFrame(self.cells)

    @property
    def verdict(self) -> dict[str, Verdict]:
        """Returns the verdict on each dataset, by its label.

        `uses` says which backend to use for the path online, for the final one and for the map, and why; `sentences`
        lists further statements, the most important first; `comparisons` are, by column of cells.csv, the tests of
        every two backends.
        """
        with Store(self.folder) as store:
            return verdicts(lines(store.cells()))

    @property
    def report(self) -> Path:
        """Returns the path of the report's page."""
        return self.folder / "report.html"

    def path(
        self, backend: str, dataset: str | None = None, seed: int = 0, *, final: bool = False
    ) -> tuple[Array, Array]:
        """Returns times (n,) and poses (n, 3) of one cell: online, or `final`, smoothed over the whole log.

        `backend` and `dataset` are named as in the tables; the dataset may be left out where there is only one.
        InputError where there is no such path.
        """
        name = "final" if final else "online"
        with Store(self.folder) as store:
            rows = [
                row
                for line in lines(store.cells())
                if line.backend == backend and dataset in (None, line.dataset)
                for row in line.rows
                if row.columns["seed"] == seed and row.columns["status"] == "done"
            ]
            arrays = store.arrays(rows[0], ("t", name)) if len(rows) == 1 else {}
        if name not in arrays:
            where = "" if dataset is None else f" on {dataset}"
            found = f"found {len(rows)} cells done" if len(rows) != 1 else f"the cell has no {name} path"
            raise InputError(f"{self.folder}, {backend}{where}, seed {seed}: {found}, expected one that has it.")
        return arrays["t"], arrays[name]

    def __repr__(self) -> str:
        console = screen_console(quiet=False)
        with console.capture() as captured, Store(self.folder) as store:
            conclude(console, lines(store.cells(), store.run()["implementations"]), store.remarks())
        return captured.get().rstrip("\n") + f"\nreport: {self.report}"

    def _repr_html_(self) -> str:
        """Returns verdicts, tables and paths as HTML, in the notebook's own style."""
        with Store(self.folder) as store:
            found, look = sections(store)
        return rendered(
            "result.html.jinja",
            {
                "sections": found,
                "looks": look,
                "report": self.report,
                "picture": lambda svg: f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}",
            },
        )


def run(
    dataset: Named | Iterable[Named] | None = None,
    backend: str | Sequence[str] | None = None,
    *,
    truth: Truth | None = None,
    seeds: int | None = None,
    out: Path | str | None = None,
    jobs: int = 1,
    timeout_s: float | None = None,
    memory_mb: int | None = None,
    map: Path | str | None = None,  # noqa: A002 - the option's name
    map_fixed: bool | None = None,
    start: str | None = None,
    oracle: bool | None = None,
    retry: bool = False,
    strict: bool = False,
    quiet: bool = True,
) -> Result:
    """Runs backends on datasets as `bench run` does and returns the results.

    `dataset` is a name with its options, a path, a `Log`, a `Dataset`, or several of these; `truth` belongs to a single
    `Log`. Results go to `out`, by default results/DATE-TIME; a run that was stopped is continued. The other arguments
    are the options of the command line. SlamduelError, with a sentence, for anything that cannot be used.
    """
    folder = (
        Path(_kind("out", out, str | Path)) if out is not None else Path("results") / time.strftime("%Y%m%d-%H%M%S")
    )
    said = {
        "seeds": seeds,
        "timeout_s": timeout_s,
        "memory_mb": memory_mb,
        "map": str(map) if isinstance(map, Path) else map,
        "map_fixed": map_fixed,
        "start": start,
        "oracle": oracle,
        "backend": None if backend is None else _backends(backend),
    }
    given: dict[str, Any] = {name: value for name, value in said.items() if value is not None}
    held: dict[Path, Dataset] = {}
    if dataset is not None:
        given["dataset"] = ",".join(_word(one, folder, held) for one in _each(dataset, truth))
    elif truth is not None:
        raise _needless_truth()
    elif backend is not None and not begun(folder):
        raise InputError(f"{ASKER}: dataset is None, expected a name, a path, a Log or a Dataset(log, truth).")
    as_whole("jobs", jobs, 1)
    planned(given, folder)
    with _written(held, folder), Screen(screen_console(quiet=quiet)) as screen:
        words = [ASKER, *(f"{name}={value}" for name, value in given.items())]
        with contextlib.closing(Local(jobs)) as executor:
            benchmark(given, folder, executor, words, screen, retry=retry, strict=strict)
    return Result(folder)


def _kind(name: str, value: Any, kind: Any) -> Any:
    if not isinstance(value, kind):
        raise InputError(f"{ASKER}: {name} is {value!r}, expected a text or a Path.")
    return value


def _backends(backend: Any) -> str:
    several = [backend] if isinstance(backend, str) else backend if isinstance(backend, Sequence) else [None]
    if not all(isinstance(one, str) for one in several):
        raise InputError(f"{ASKER}: backend is {backend!r}, expected names: a text, or a list of texts.")
    names = ",".join(several)
    backend_variants(names, ASKER)
    return names


def _each(dataset: Any, truth: Any) -> list[Named]:
    several: list[Any] = [dataset]
    if isinstance(dataset, Iterable) and not isinstance(dataset, str | Log | Dataset):
        several = list(dataset)
    for found in several:
        if not isinstance(found, str | Path | Log | Dataset):
            raise InputError(f"{ASKER}: dataset is {found!r}, expected a name, a path, a Log or a Dataset(log, truth).")
    if not several:
        raise InputError(f"{ASKER}: dataset is empty, expected at least one.")
    if truth is None:
        return several
    if len(several) != 1 or not isinstance(several[0], Log):
        raise _needless_truth()
    return [Dataset(several[0], truth)]


def _needless_truth() -> InputError:
    return InputError(f"{ASKER}: found a truth, expected one Log that it belongs to, or Dataset(log, truth).")


def _word(dataset: Named, folder: Path, held: dict[Path, Dataset]) -> str:
    """Returns the dataset's label; a log in memory is put into `held`. InputError where it cannot be used."""
    if isinstance(dataset, str):
        dataset_variants(dataset, ASKER)
        return dataset
    if isinstance(dataset, Path):
        return dataset_at(dataset, ASKER).label
    log, truth = dataset if isinstance(dataset, Dataset) else (dataset, None)
    if not isinstance(log, Log):  # pyright: ignore[reportUnnecessaryIsInstance] - it comes from a user
        raise InputError(f"{ASKER}: the log of a dataset is {log!r}, expected a Log.")
    log_folder.check_writable(log, truth)
    place = folder / LOGS / (re.sub(r"[^\w.-]+", "-", log.name)[:LONGEST].strip("-.") or "log")
    if place in held:
        both = f"{held[place].log.name!r} and {log.name!r}"
        raise InputError(
            f"{ASKER}: found logs named {both}, which would both be kept in {place}; expected other names."
        )
    label = dataset_at(place, ASKER, "log").label
    if place.exists() and not _same(log_folder.read(place), Dataset(log, truth)):
        raise InputError(
            f"{place}: holds another log named {log.name}, or another truth of it, expected the same, or another name "
            "or folder."
        )
    held[place] = Dataset(log, truth)
    return label


def _same(kept: Dataset, given: Dataset) -> bool:
    """Returns True if `given` is the `kept` log: written and read, it has the same factors and the same truth."""
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        log_folder.write(Path(scratch) / LOGS, *given)
        again = log_folder.read(Path(scratch) / LOGS)
    told = [None if truth is None else truths.digest(truth) for truth in (kept.truth, again.truth)]
    return kept.log.digest == again.log.digest and told[0] == told[1]


@contextlib.contextmanager
def _written(held: Mapping[Path, Dataset], folder: Path) -> Generator[None]:
    """Writes the logs that Python holds into their places; removes them again if no run was begun."""
    missing = [path for path in (folder / LOGS, folder, *folder.parents) if not path.exists()]
    new = [place for place in held if not place.exists()]
    try:
        for place in new:
            log_folder.write(place, *held[place])
        yield
    finally:
        if not begun(folder):
            for place in new:
                shutil.rmtree(place, ignore_errors=True)
            for path in missing if new else ():
                with contextlib.suppress(OSError):  # not empty: of another program
                    path.rmdir()
