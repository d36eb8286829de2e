"""Stretches of a log: short ones, spread over it, with enough measurements too many to tell if they agree."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Log, Prior

STRETCHES = 3
ENOUGH = 600
"""Degrees of freedom of a stretch: J per degree of freedom of a log whose noise is as stated is then 1 +- 0.06."""

LEAST = 30
"""Degrees of freedom of a log that is looked at: 1 +- 0.26."""

SHORTEST, LONGEST = 100, 3_200
"""Steps: a stretch is twice as long until it has enough."""

ABOVE = 3.0
"""Standard deviations, of a way and either way of a range; less tells nothing."""

START = 1e-6
"""m^2 and rad^2; the variance of a stretch's start, which its measurements say nothing about."""


def stretches(log: Log) -> Iterator[Log]:
    """Yields stretches of the log, in order; none of a log with too few measurements to tell."""
    n, length = len(log), SHORTEST
    while True:
        starts = np.unique(np.linspace(0, max(n - length, 0), STRETCHES).astype(int)).tolist()
        found = [(start, min(start + length, n)) for start in starts]
        freedom = [degrees_of_freedom(log, *part) for part in found]
        if max(freedom) >= ENOUGH or length >= min(n, LONGEST):
            break
        length *= 2
    yield from (part_of(log, *part) for part, dof in zip(found, freedom, strict=True) if dof >= LEAST)


def degrees_of_freedom(log: Log, first: int, end: int) -> int:
    """Measurements of the steps from `first` to before `end` less what they determine: poses and landmarks."""
    seen = slice(log.sighting_first[first], log.sighting_first[end])
    return 2 * (seen.stop - seen.start - len(np.unique(log.ids[seen]))) + 3 * int(_loops(log, first, end).sum())


def tells(log: Log) -> bool:
    """True where way and ranges are of a robot that drives: what noise swallows agrees with everything."""
    way, variance = np.hypot(*log.delta[1:, :2].T).sum(), log.delta_cov[1:, 0, 0].sum()
    if not len(log.ids):
        return bool(way > ABOVE * np.sqrt(variance))
    _, of = np.unique(log.ids, return_inverse=True)
    farthest, nearest = np.full(of.max() + 1, -np.inf), np.full(of.max() + 1, np.inf)
    np.maximum.at(farthest, of, log.z[:, 0])
    np.minimum.at(nearest, of, log.z[:, 0])
    again = farthest > nearest
    change = np.median((farthest - nearest)[again]) if again.any() else 0.0
    return bool(way > ABOVE * np.sqrt(variance) and change > 2 * ABOVE * np.sqrt(np.median(log.z_cov[:, 0, 0])))


def part_of(log: Log, first: int, end: int) -> Log:
    """The steps from `first` to before `end`, from the origin with the heading of dead reckoning."""
    seen, loops = slice(log.sighting_first[first], log.sighting_first[end]), _loops(log, first, end)
    rows = np.arange(log.loop_first[first], log.loop_first[end])[loops]
    return Log.from_arrays(
        log.name,
        Prior(np.array([0.0, 0.0, log.prior.pose[2] + log.delta[1 : first + 1, 2].sum()]), START * np.eye(3)),
        log.t[first:end],
        log.delta[first:end],
        log.delta_cov[first:end],
        log.sighting_step[seen] - first,
        log.ids[seen],
        log.z[seen],
        log.z_cov[seen],
        loop_step=log.loop_step[rows] - first,
        loop_to=log.loop_to[rows] - first,
        loop_delta=log.loop_delta[rows],
        loop_cov=log.loop_cov[rows],
    )


def _loops(log: Log, first: int, end: int) -> NDArray[np.bool_]:
    """Tells which of the loop closures of the steps are with one of them."""
    return log.loop_to[log.loop_first[first] : log.loop_first[end]] >= first
