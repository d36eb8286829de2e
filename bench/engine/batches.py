"""Makes batches of planned cells for an executor."""

from collections.abc import Mapping
from dataclasses import replace

from ..measure.cell import Job
from ..plan.work import PlannedCell, Work
from ..workers.batch import Batch, KeptLog


def batch_of(
    work: Work,
    cell: PlannedCell,
    cells: Mapping[int, PlannedCell],
    kept: KeptLog | None = None,
    *,
    whole: bool = False,
    number: int = 1,
) -> Batch:
    """Makes a batch of cells by place in that round, all on the log of `cell`; none to look at the log."""
    log = cell.cell.log
    dataset = log.dataset
    jobs = tuple((place, replace(job_of(work, one), again=number > 1)) for place, one in cells.items())
    known = None if work.map is None else work.map.of(cell.cell.dataset, cell.cell.seed)
    start = "known" if work.map is None else work.map.start
    made_of = dataset.name, dataset.options, log.seed, jobs, work.timeout_s, work.keep
    return Batch(*made_of, kept, whole, known, start, number)


def job_of(work: Work, cell: PlannedCell) -> Job:
    """Makes the job of a cell."""
    backend = cell.cell.backend
    seed, missing = cell.cell.seed, backend.missing
    return Job(backend.label, backend.name, backend.options, seed, work.memory_mb, work.oracle, missing)
