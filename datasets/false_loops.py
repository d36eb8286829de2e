"""Plants false loop closures in a log, as an option of datasets that have loops.

They are what scan matching finds where two places look alike: a relative pose between two steps that is nowhere near
the true one, stated as precisely as a correct one. They are drawn from a generator of their own: everything else of the
log is the same, bit for bit, and a larger share includes the loops of a smaller one.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..core.errors import InputError
from ..core.factors import Dataset, Truth
from ..core.options import option
from ..core.se2 import Array, Ints, between, wrap

FALSE_NOTE = "false loops"  # the key of how many were planted, among the log's notes

Column = TypeVar("Column", Array, Ints)


@dataclass(frozen=True)
class FalseLoops:
    """The false loop closures of a log, by default none; a dataset's options inherit it."""

    false_loops: float = option(
        0.0, "false loop closures that are added, as a share of the log's own", minimum=0.0, maximum=0.5
    )


def planted(dataset: Dataset, share: float, rng: np.random.Generator) -> Dataset:
    """Adds `share` times as many false loops as the log has loops; the truth's `false_loops` has their rows, too.

    Each is between two random steps. It puts the later one anywhere in the rectangle around the dead-reckoned path, at
    any heading, with the covariance of one of the log's own loops. A log without ground truth gets one without path and
    map. InputError for a log without loops.
    """
    if not share:
        return dataset
    log, truth = dataset
    own = len(log.loop_to)
    if not own:
        raise InputError(f"option false_loops={share:g}: {log.name} has no loop closures, expected some to add to.")
    path, draws = log.dead_reckoned(), rng.random((round(share * own), 6))  # a row per loop: more rows begin with fewer
    step = 1 + (draws[:, 0] * (len(log) - 1)).astype(np.int64)
    to = (draws[:, 1] * step).astype(np.int64)
    low, high = path[:, :2].min(axis=0), path[:, :2].max(axis=0)
    claimed = np.column_stack((low + draws[:, 2:4] * (high - low), np.pi - 2 * np.pi * draws[:, 4]))
    delta = between(path[to], claimed)
    delta[:, 2] = wrap(delta[:, 2])
    cov = log.loop_cov[(draws[:, 5] * own).astype(np.int64)]
    steps = np.concatenate((log.loop_step, step))
    order = np.argsort(steps, kind="stable")  # after the step's own
    truth = truth or Truth(np.zeros(0), np.zeros((0, 3)))
    faulty = replace(
        log,
        loop_first=_frozen(np.searchsorted(steps[order], np.arange(len(log) + 1))),
        loop_to=_frozen(np.concatenate((log.loop_to, to))[order]),
        loop_delta=_frozen(np.concatenate((log.loop_delta, delta))[order]),
        loop_cov=_frozen(np.concatenate((log.loop_cov, cov))[order]),
        notes={**log.notes, FALSE_NOTE: f"{len(step)} of {len(steps)}"},
    )
    false = order >= own if truth.false_loops is None else (order >= own) | np.isin(order, truth.false_loops)
    return Dataset(faulty, truth._replace(false_loops=_frozen(np.flatnonzero(false))))


def _frozen(column: Column) -> Column:
    column.flags.writeable = False
    return column
