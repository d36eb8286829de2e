"""The noise of a log without a true path: the EKF's innovations, and residuals of the batch optimum."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...backends import registry as backends
from ...backends.api import Diverged
from ...core.errors import InputError
from ...core.factors import Dataset, Log
from ...core.se2 import Array
from ...core.truth.errors import difference, named, rows_of
from ...datasets.noise.model import SightingModel
from ...datasets.noise.stated import scaled
from ..plan.reference import reference
from ..systematic.estimated import Estimated
from .likelihood import Maximum, maximum
from .sightings import Sighted, sighted

LONGEST = 1500  # steps that are looked at, from the log's first one
FEWEST = 30  # fewest sightings of landmarks sighted before

_EVERY = 1e12  # a gate that no landmark is beyond
_WIDEST = np.log(30.0)  # of the factors, either way


class Innovations(NamedTuple):
    """Factors on the stated standard deviations that make the innovations likeliest."""

    translation: Estimated
    turn: Estimated
    range: Estimated
    bearing: Estimated
    counted: int  # innovations
    steps: int  # of the log, that were looked at

    def stated(
        self, residuals: Sequence[SightingModel | None]
    ) -> tuple[Sequence[float], SightingModel | None, SightingModel | None]:
        """Factors of odometry and both noises, with the correlation that the residuals show."""
        range_, bearing = (
            SightingModel(found.value, 0.0, 1.0, 0.0, share, time, 0.0)
            for found, one in zip((self.range, self.bearing), residuals, strict=True)
            for share, time in [(0.0, 1.0) if one is None else (one.share, one.time)]
        )
        return [self.translation.value, self.translation.value, self.turn.value], range_, bearing


def by_innovations(dataset: Dataset, label: str) -> tuple[Innovations, Sighted | None]:
    """Fits the four factors, and returns the residuals of the batch optimum, None where there is none.

    InputError for a log without landmarks that are sighted again.
    """
    log = named(*dataset).identified().without_loops()
    if log.prior.start != "known" or len(log) < 2:
        raise InputError(f"{label}: found no known start, expected a true path or a known start to fit noise by.")
    counted = len(log.ids) - len(np.unique(log.ids))
    if counted < FEWEST:
        raise InputError(
            f"{label}: found no true path and {counted} sightings of landmarks sighted before, expected at least "
            f"{FEWEST} of these: nothing in the log tells how large its errors are."
        )
    head = log.head(min(len(log), LONGEST))

    def log_likelihood(p: Array) -> float:
        found = likelihood(scaled_by(head, np.exp(p)))
        return -1e12 if found is None else found

    best = maximum(log_likelihood, np.zeros(4), np.full(4, -_WIDEST), np.full(4, _WIDEST))
    if best.value == -1e12:
        raise InputError(f"{label}: the EKF gets lost, expected a log that it can follow, or a true path.")
    translation, turn, range_, bearing = (_factor(best, k) for k in range(4))
    used = len(head.ids) - len(np.unique(head.ids))
    optimum = reference(log)
    rough = None if optimum is None else sighted(log, optimum)
    return Innovations(translation, turn, range_, bearing, used, len(head)), rough


def _factor(best: Maximum, k: int) -> Estimated:
    """Factor `k`. At an end of the search its interval is open there: to 0, or to infinity."""
    value, low, high = best.estimate(k, lambda p: float(np.exp(p)))
    ends = 0.0 if best.at[k] <= -_WIDEST else low, np.inf if best.at[k] >= _WIDEST else high
    return Estimated(value, *ends)


def scaled_by(log: Log, factors: Array) -> Log:
    """The log with its standard deviations times `factors` (4,): of translation, turn, range and bearing."""
    size = np.outer(factors[2:], factors[2:])
    return replace(log, delta_cov=scaled(log.delta_cov, factors[[0, 0, 1]]), z_cov=log.z_cov * size)


def likelihood(log: Log) -> float | None:
    """The log-likelihood of the EKF's innovations; None where it gets lost."""
    builder = backends.find("ekf")
    ekf: Any = builder.make(log.prior, builder.options(), np.random.default_rng(0))
    total = 0.0
    try:
        for step in log:
            if len(step.sightings.ids):
                expected = ekf.expected(step.odometry, step.sightings, _EVERY)
                at = rows_of(expected.ids, step.sightings.ids)
                seen = np.flatnonzero(at >= 0)
                if len(seen):
                    cells = (2 * at[seen, None] + np.arange(2)).ravel()
                    cov = expected.cov[np.ix_(cells, cells)].copy()
                    for k, row in enumerate(seen.tolist()):
                        cov[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += step.sightings.cov[row]
                    e = difference(step.sightings.z[seen], expected.z[at[seen]]).ravel()
                    total -= 0.5 * float(e @ np.linalg.solve(cov, e) + np.linalg.slogdet(cov)[1])
            ekf.step(step)
    except (Diverged, np.linalg.LinAlgError):
        return None
    return total if np.isfinite(total) else None
