"""A study's results for Python: `slamduel.study`."""

import contextlib
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..claims.answer import Answer
from ..engine.engine import run as run_cells
from ..engine.request import RunRequest
from ..run.result import Result
from ..study import file as study_file
from ..study.only import choice
from ..study.progress import StudyScreen
from ..study.study import about
from ..words.console import screen_console
from ..workers.local_executor import Local
from .evidence import evidence
from .report import write


class StudyResult(Result):
    """A study's folder: its cells, and the answers to its claims."""

    @property
    def answers(self) -> Sequence[Answer]:
        """The verdict on each claim, "holds", "fails" or "open", with a sentence."""
        return evidence(self.folder).answers

    @property
    def conclusion(self) -> str:
        """The study's conclusion in a sentence."""
        return evidence(self.folder).conclusion.sentence

    def __repr__(self) -> str:
        said = [self.conclusion, *(f"  {answer.sentence}" for answer in self.answers), f"report: {self.report}"]
        return "\n".join(said)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def study(
    file: Path | str,
    *,
    out: Path | str | None = None,
    full: bool = False,
    only: Sequence[str] = (),
    limit: int | None = None,
    retry: bool = False,
    jobs: int | None = None,
    quiet: bool = True,
) -> StudyResult:
    """Runs a study, a file or a packaged one, as `bench ablate` on this machine, into `out` or results/NAME."""
    found = study_file.read(str(file), full=full)
    folder = Path(out) if out is not None else Path("results") / found.name
    request = RunRequest(choice(found, only), limit, retry)
    command = ["bench", "ablate", str(file), "--out", str(folder), *["--full"] * full]
    with (
        StudyScreen(screen_console(quiet=quiet)) as screen,
        contextlib.closing(Local(jobs or os.cpu_count() or 1)) as executor,
    ):
        run_cells(found, folder, executor, request, about(found, folder, command), screen)
    write(folder)
    return StudyResult(folder)
