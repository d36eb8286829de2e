"""The studies that come along: each says what it asks and whom it follows, and its cells run to what it measures."""

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.backends.programs import mrpt_ekf
from slamduel.bench.engine.engine import run
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.plan.work import PlannedCell
from slamduel.bench.study import file as study_file
from slamduel.bench.study.study import about
from slamduel.bench.study_report.evidence import evidence
from slamduel.bench.workers.local_executor import Local
from slamduel.datasets.published.catalogue import PUBLISHED, place
from small_run import Silent

STUDIES = study_file.packaged()


@pytest.fixture(scope="module")
def pool() -> Generator[Local]:
    found = Local(1)  # a second process would load all of it, and make each log, once more
    yield found
    found.close()


def recorded(cell: PlannedCell) -> bool:
    """Tells if the cell's log is a published one, which has to be fetched."""
    return cell.cell.dataset.name in PUBLISHED


def at_hand(cell: PlannedCell) -> bool:
    """Tells if the cell's log is made up, or a recording that is there, and its backend's program is installed."""
    if cell.cell.backend.name == "mrpt-ekf" and mrpt_ekf.lacking():
        return False
    return not recorded(cell) or place(cell.cell.dataset.name).is_dir()


class Watched(Silent):
    """Which cells ended otherwise than they should."""

    def __init__(self) -> None:
        super().__init__()
        self.amiss: list[tuple[object, ...]] = []

    def finished(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        if row["status"] != "done":
            self.amiss.append((cell.cell.dataset.label, cell.cell.backend.label, row["status"], row["reason"]))


def few(cells: Sequence[PlannedCell]) -> list[PlannedCell]:
    """Of every backend, as the file writes it, the first and the last it is swept to, on the first log of either.

    And the last backend on the last log: what a log is swept to (landmarks that move, say) may make a measure possible.
    """
    by: dict[str, dict[str, PlannedCell]] = {}
    for cell in cells:
        by.setdefault(cell.parameters["backend"], {}).setdefault(cell.cell.backend.label, cell)
    variants = [list(swept.values()) for swept in by.values()]
    chosen = [cell for swept in variants for cell in (swept[:1] if len(swept) == 1 else [swept[0], swept[-1]])]
    last = cells[-1]
    first_seed = next(cell for cell in cells if cell.cell.key == last.cell.key)
    return chosen if first_seed in chosen else [*chosen, first_seed]


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("name", STUDIES)
def test_it_says_what_it_asks_and_whom_it_follows(name: str, full: bool) -> None:
    study = study_file.read(name, full=full)
    assert study.question.endswith("?")
    assert study.source
    assert study.finding.endswith(".")
    assert study.claims
    assert study.figures
    for figure in study.figures:
        assert figure.title, figure
        assert not figure.title.endswith("."), figure
        assert figure.caption.endswith("."), figure
    for claim in study.claims:
        assert not claim.says.endswith("."), claim
    says = [claim.says for claim in study.claims]
    assert len(set(says)) == len(says)


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_its_cells_run_and_have_what_it_measures(name: str, pool: Local, tmp_path: Path) -> None:
    study = study_file.read(name, full=False)
    there = [cell for cell in study.cells if at_hand(cell)]
    if not there:
        pytest.skip("SLAMDUEL_DATA is not set, or has none of its recordings; or no program of it is installed")
    cells = few(there)
    chosen = {(cell.cell.key, cell.cell.seed) for cell in cells}
    watched = Watched()
    wanted = RunRequest(lambda cell: (cell.cell.key, cell.cell.seed) in chosen, None, False)
    tally = run(study, tmp_path, pool, wanted, about(study, tmp_path, ["bench", "ablate", name]), watched)
    assert not watched.amiss
    assert tally.done == len(chosen)
    known = any(recorded(cell) for cell in cells) or not any(recorded(cell) for cell in study.cells)
    found = evidence(tmp_path)
    for name in {claim.measure for claim in study.claims} | {figure.y for figure in study.figures}:
        if known or "relation" not in name:  # which only recordings have
            assert np.isfinite(found.table.columns[name].astype(float)).any(), name
    for answer in found.answers:  # none of a simulated log, of which all seeds are needed, has its answer yet
        if "1 log)" not in answer.sentence:
            assert answer.verdict == "open"
            assert answer.waiting, answer.sentence  # as it would not be where no result could answer the claim
