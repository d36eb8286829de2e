"""Runs a random sample of the cells of a results folder again, and compares their accuracy and consistency."""

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from ...backends import registry
from ..measure.cell import Job, Result
from ..record.machine import environment
from ..verdict.pairing import one_processor
from ..words.columns import COLUMNS
from ..words.numerals import counted, listed
from ..workers.batch import Batch
from ..workers.executor import Executor
from .folder import HOLDS, OPEN, CheckedCell, Finding, ResultsFolder, faults
from .logs import TrustedLog

SAMPLE = 5  # cells that are run again where no number is given, at least; one of each backend

TOLERANCE = 1e-3
"""Share by which a cell's accuracy and consistency may differ. Paths are the same bit for bit on one machine only; on
another processor last bits differ, and those of a stopped iteration more."""

RANDOM = 1.0
"""That share where a backend draws at random and the processor or a library is another one: once a last bit differs, it
takes other draws."""

ROUNDED = 1e-6  # m, rad or of a share: what is smaller is rounding

COMPARED = tuple(
    name
    for name, column in COLUMNS.items()
    if column.kind.is_error or column.kind.is_nees or column.kind.expected == 0.95
)
"""Columns of accuracy and consistency; never costs, which are those of a machine."""


def drawn(
    found: ResultsFolder, trusted: Mapping[str, TrustedLog], sample: int, rng: np.random.Generator
) -> list[CheckedCell]:
    """Draws cells that are done and can be run here, of each backend in turn, those from elsewhere first."""
    able: dict[str, list[CheckedCell]] = {}
    for cell in found.cells:
        c = cell.row.columns
        if c["status"] == "done" and cell.backend is not None and cell.log_label in trusted:
            able.setdefault(cell.backend.label, []).append(cell)
    names = [list(able)[k] for k in rng.permutation(len(able))]
    names.sort(key=lambda name: name.partition("[")[0] in registry.BUILTIN)
    turns = {name: [able[name][k] for k in rng.permutation(len(able[name]))] for name in names}
    return [cell for row in zip_longest(*turns.values()) for cell in row if cell is not None][:sample]


def check_cells(
    found: ResultsFolder,
    trusted: Mapping[str, TrustedLog],
    sample: int | None,
    seed: int,
    executor: Executor,
    ran: Callable[[str], None],
) -> tuple[list[Finding], list[str]]:
    """Runs `sample` cells again, drawn with `seed`; returns the findings and the backend of each that was run.

    `ran` is called with the name of each that has ended.
    """
    wanted = sample or max(SAMPLE, len(found.backends))
    cells = drawn(found, trusted, wanted, np.random.default_rng(seed))
    said = _not_run(found, trusted)
    if not cells:
        return [*said, Finding("cells", OPEN, "No cell was run again.")], []
    batches = [_batch(found, cell, trusted[cell.log_label], place) for place, cell in enumerate(cells)]
    same_code = _same_code(found)
    failed, largest = list[str](), ("", 0.0)
    with contextlib.closing(executor.run(batches, alone=False)) as ended:
        for finished in ended:
            assert finished.index is not None
            cell = cells[finished.index]
            ran(str(cell))
            random = cell.backend is not None and cell.backend.builder is not None and cell.backend.builder.random
            tolerance = RANDOM if random and not same_code else TOLERANCE
            wrong, apart = compared(cell.row.columns, finished.result, tolerance)
            failed += [f"{cell}: {one}" for one in wrong]
            largest = max(largest, (f"{apart[0]} of {cell}", apart[1]), key=lambda one: one[1])
    said += faults("cells", [f"{one}." for one in failed])
    if not failed:
        names = listed(list(dict.fromkeys(cell.backend_label for cell in cells)), 6)
        how = f"{counted(len(cells), 'cell')} of {names} run again (drawn with --seed {seed})"
        near = f"equal within {100 * TOLERANCE:g} %; the largest difference is {100 * largest[1]:.2g} %, {largest[0]}"
        same = near if largest[1] else "identical"
        said.append(Finding("cells", HOLDS, f"{how}: accuracy and consistency are {same}."))
    return said, [cell.backend_label for cell in cells]


def _not_run(found: ResultsFolder, trusted: Mapping[str, TrustedLog]) -> list[Finding]:
    """Says of which backends no cell can be run here, and why."""
    why: dict[str, list[str]] = {}
    for cell in found.cells:
        if cell.backend is None and cell.row.columns["status"] == "done" and cell.log_label in trusted:
            why.setdefault(cell.unknown.rstrip("."), []).append(cell.backend_label)
    checked = "digests and scores from its paths were checked"
    said = {reason: listed(list(dict.fromkeys(names))) for reason, names in why.items()}
    return [Finding("cells", OPEN, f"{names}: not run again ({reason}); {checked}.") for reason, names in said.items()]


def _batch(found: ResultsFolder, cell: CheckedCell, log: TrustedLog, place: int) -> Batch:
    run, backend = found.run, cell.backend
    assert backend is not None
    assert cell.log is not None
    seed = cell.row.columns["seed"]
    memory, oracle = int(run.get("memory_mb", 8000)), bool(run.get("oracle", False))
    job = Job(backend.label, backend.name, backend.options, seed, memory, oracle)
    of, timeout_s = cell.log.dataset, float(run.get("timeout_s", 1800.0))
    return Batch(of.name, of.options, cell.log.seed, ((place, job),), timeout_s, keep=True, kept=log.kept)


def _same_code(found: ResultsFolder) -> bool:
    """True where processor, packages and revision are those of the run: then every bit is the same."""
    here = environment()
    same = all(found.run["environment"].get(name) == here[name] for name in ("packages", "python", "revision"))
    return same and one_processor(found.run, {"environment": here})


def compared(row: Mapping[str, Any], result: Result, tolerance: float) -> tuple[Sequence[str], tuple[str, float]]:
    """Compares a cell with its second run: what differs by more than the tolerance, and the largest difference."""
    if result.status != "done":
        return [f"ended as done, here as {result.status}: {result.reason}"], ("", 0.0)
    wrong, largest = list[str](), ("", 0.0)
    for name in COMPARED:
        before, now = row.get(name), result.row.get(name)
        if before is None or now is None:
            if before is not now:
                wrong.append(f"{name} is {'none' if before is None else f'{before:.6g}'}, run again {now!r:.12}")
            continue
        if math.isclose(before, now, rel_tol=1e-12, abs_tol=ROUNDED * 1e-3):
            continue
        apart = abs(before - now) / max(min(abs(before), abs(now)), ROUNDED)  # as a share of the smaller
        if apart > tolerance:
            wrong.append(f"{name} is {before:.6g}, run again {now:.6g}")
        largest = max(largest, (name, apart), key=lambda one: one[1])
    return wrong, largest
