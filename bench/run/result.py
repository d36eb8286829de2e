"""The results of a run's folder, for Python and for notebooks: `slamduel.run`."""

import base64
import contextlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.factors import Truth
from ...core.se2 import Array
from ..drawing.page import rendered
from ..plan.spec import backend_variants
from ..plan.values import as_whole
from ..record.store import Store
from ..report.section import recorded, sections
from ..verdict.summary import lines
from ..verdict.verdict import Verdict
from ..words.console import screen_console
from ..workers.local_executor import Local
from .benchmark import asked, begun, benchmark, folder_for, planned
from .held import ASKER, EXPECTED, Held, Named, each, needless_truth
from .progress import Screen
from .terminal import conclude, verdicts


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
        """The cells as a pandas frame, one row each; InputError where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise InputError("Result.table: expected pandas to be installed; Result.cells is without.") from None
        return pandas.DataFrame(self.cells)

    @property
    def verdict(self) -> dict[str, Verdict]:
        """The verdict on each dataset, by its label.

        `uses` says which backend to use for the path online, for the final one and for the map, and why; `sentences`
        lists further statements, the most important first; `comparisons` are, by column of cells.csv, the tests of
        every two backends.
        """
        with Store(self.folder) as store:
            return verdicts(lines(store.cells()))

    @property
    def report(self) -> Path:
        """The path of the report's page."""
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
        with Store(self.folder) as store:
            record = recorded(store)
        with console.capture() as captured:
            conclude(console, record.lines, record.remarks)
        return captured.get().rstrip("\n") + f"\nreport: {self.report}"

    def _repr_html_(self) -> str:
        """Returns verdicts, tables and paths as HTML, in the notebook's own style."""
        with Store(self.folder) as store:
            found, look = sections(store, recorded(store))
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
    logs: Iterable[Named] | Mapping[str, Iterable[Named]] | None = None,
    truth: Truth | None = None,
    seeds: int | None = None,
    repeats: int | None = None,
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
    `Log`. `logs` are the logs of one dataset, with one verdict: a list of such, or lists by the name of the cluster
    that they are of, as logs that share a run, a robot or a building are not independent. With `repeats` every cell is
    timed in so many rounds, by default small ones in five; nothing is claimed of costs that were measured once.
    Results go to `out`, by default results/DATE-TIME; with `out` alone, a run that was stopped is continued. The
    other arguments are the command line's options. SlamduelError, with a sentence, for anything that cannot be used.
    """
    said = {
        "seeds": seeds,
        "repeats": repeats,
        "timeout_s": timeout_s,
        "memory_mb": memory_mb,
        "map": str(map) if isinstance(map, Path) else map,
        "map_fixed": map_fixed,
        "start": start,
        "oracle": oracle,
        "backend": None if backend is None else _backends(backend),
    }
    given: dict[str, Any] = {name: value for name, value in said.items() if value is not None}
    with folder_for(None if out is None else Path(_kind("out", out, str | Path))) as folder:
        held = Held(folder)
        words = [held.word(one) for one in each(dataset, truth)] if dataset is not None else []
        words += [held.together(logs)] if logs is not None else []
        if words:
            given["dataset"] = ",".join(words)
        if dataset is None and truth is not None:
            raise needless_truth()
        if not words and backend is not None and not begun(folder):
            raise InputError(f"{ASKER}: dataset is None, expected {EXPECTED}.")
        as_whole("jobs", jobs, 1)
        wanted = asked(given, None if out is None else folder)
        if logs is None:
            planned(wanted, folder)
        with held.written(), Screen(screen_console(quiet=quiet)) as screen:
            command = [ASKER, *(f"{name}={value}" for name, value in given.items())]
            with contextlib.closing(Local(jobs)) as executor:
                benchmark(wanted, folder, executor, command, screen, retry=retry, strict=strict)
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
