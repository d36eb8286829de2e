"""What a run left in its folder, for Python and for a notebook, where it shows itself."""

import base64
import re
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..datasets import logfile
from ..frontend.errors import InputError
from ..frontend.factors import Dataset, Log, Truth
from ..frontend.se2 import Array
from .benchmark import DEFAULTS, benchmark
from .plan import Plan
from .report import rendered, sections
from .runner import LOGS
from .store import Store
from .summary import lines
from .terminal import Screen, screen_console, tables

Named = str | Path | Log | Dataset
"""A dataset: as on the command line, the path of a log or of a recording, or a log that Python holds."""


class Result:
    """A run's folder. `cells` are the rows of cells.csv, by column; a notebook shows the verdicts, tables and paths."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)

    @property
    def cells(self) -> list[dict[str, Any]]:
        """A dictionary a cell, by column of cells.csv; None where there is no value."""
        with Store(self.folder) as store:
            return [dict(row.columns) for row in store.cells()]

    @property
    def report(self) -> Path:
        """The page with everything."""
        return self.folder / "report.html"

    def path(
        self, backend: str, dataset: str | None = None, seed: int = 0, *, final: bool = False
    ) -> tuple[Array, Array]:
        """Times (n,) and poses (n, 3) of one cell: those given step by step, or `final`, smoothed over the whole log.

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
            console.print(*tables(lines(store.cells()), console.width))
        return captured.get().rstrip("\n") + f"\nreport: {self.report}"

    def _repr_html_(self) -> str:
        """Verdicts, tables and paths, with no style of their own but the tables': a notebook has one."""
        with Store(self.folder) as store:
            found, look = sections(store)
        return rendered(
            "result.html.jinja", {"sections": found, "looks": look, "report": self.report, "picture": _data}
        )


def run(
    dataset: Named | Iterable[Named] | None = None,
    backend: str | Sequence[str] | None = None,
    *,
    truth: Truth | None = None,
    seeds: int | None = None,
    out: Path | str | None = None,
    jobs: int = 1,
    quiet: bool = True,
    **limits: Any,
) -> Result:
    """Run backends on datasets as `bench run` does, each cell in a process of its own, and return what came of it.

    `dataset` is a name with its options, a path, a `Log`, a `Dataset`, or several of these; `truth` belongs to a single
    `Log`. Results go to `out`, which is results/DATE-TIME where nothing is said; a run that was stopped goes on where
    it was. `limits` are those of the command line: timeout_s, memory_mb, map, map_fixed, oracle. SlamduelError, with a
    sentence, for anything that cannot be used.
    """
    folder = Path(out) if out is not None else Path("results") / time.strftime("%Y%m%d-%H%M%S")
    unknown = sorted(set(limits) - set(DEFAULTS))
    if unknown:
        raise InputError(f"slamduel.run: there is no argument {unknown[0]!r}, expected one of {', '.join(DEFAULTS)}.")
    given: dict[str, Any] = {name: value for name, value in limits.items() if value is not None}
    if seeds is not None:
        given["seeds"] = seeds
    if backend is not None:
        given["backend"] = backend if isinstance(backend, str) else ",".join(backend)
    Plan.from_words(DEFAULTS | given)  # before anything is written
    if dataset is not None:
        given["dataset"] = ",".join(_word(one, folder) for one in _each(dataset, truth))
    console = screen_console(quiet=quiet)
    with Screen(console, quiet=quiet) as screen:
        benchmark(given, folder, jobs, ["slamduel.run", *(f"{name}={value}" for name, value in given.items())], screen)
    return Result(folder)


def _each(dataset: Named | Iterable[Named], truth: Truth | None) -> list[Named]:
    """The datasets, a log together with its truth."""
    several = [dataset] if isinstance(dataset, str | Path | Log | Dataset) else list(dataset)
    if truth is None:
        return several
    if len(several) != 1 or not isinstance(several[0], Log):
        raise InputError("slamduel.run: found a truth, expected one Log that it belongs to, or Dataset(log, truth).")
    return [Dataset(several[0], truth)]


def _word(dataset: Named, folder: Path) -> str:
    """What the command line would call the dataset; a log that Python holds is written into the run's folder first."""
    if isinstance(dataset, str):
        return dataset
    if isinstance(dataset, Path):
        return f'"{dataset}"' if "," in str(dataset) else str(dataset)
    log, truth = dataset if isinstance(dataset, Dataset) else (dataset, None)
    plain = re.sub(r"[^\w.-]+", "-", log.name).strip("-.") or "log"
    place = folder / LOGS / plain
    if not place.exists():
        logfile.write(place, log, truth)
    elif logfile.read(place).log.digest != log.digest:
        raise InputError(
            f"{place}: holds another log named {log.name}, expected the same one, or another name or folder."
        )
    return f'log[path="{place}"]'


def _data(svg: str) -> str:
    """A figure as the address of an image: nothing of it can meet the page's own style."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
