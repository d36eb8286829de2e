"""The cells of a work that are to be run now."""

from collections.abc import Callable
from typing import NamedTuple

from ..plan.work import PlannedCell


def everything(cell: PlannedCell) -> bool:
    """Selects every cell."""
    del cell
    return True


class RunRequest(NamedTuple):
    """The cells to be run now."""

    chosen: Callable[[PlannedCell], bool] = everything
    limit: int | None = None  # cells at most
    retry: bool = False  # failed ones, too
    strict: bool = False  # a log with a remark is refused, where all logs are made first
