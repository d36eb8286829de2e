"""Tells if a ground truth can be that of a log: it goes as far as the odometry does, and turns where that turns.

A truth that does not, or only its headings, cannot say how large errors are, nor if covariances are as stated.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..factors import Log, Truth
from ..se2 import Array, Ints

FEWEST = 3  # true poses from which on a path has a shape
STRETCHES = (16, 32, 64, 128)
"""Numbers of stretches of a log, in each of which ways are compared: drift is small there, and noise in the longest."""
APART = 1.5  # times as far as the other, from which on neither a wheel's size nor slip is the reason
MOST = 0.75  # share of those numbers of stretches
MOVING = 0.5  # m from end to end of a path, below which its robot may stand: odometry and truth both jitter
TURNING = 0.5  # rad from end to end of the odometry's headings, below which it may go straight
UNTURNED = 0.02  # rad within which all headings are one
ASIDE, ALIKE = 0.3, 0.9
"""rad, and mean resultant length: of angles between motions by truth and by odometry, each from its own headings. They
are of one constant beyond the one, if the other is exceeded; wheels hold it within 0.05 rad of 0."""
FOLLOWS = 0.5  # share of a path's bends that is left without the odometry's turns, if it is these that bend it


class Ways(NamedTuple):
    """The ways of truth and odometry between the same steps, compared."""

    factor: float  # of the truth over the odometry, median; infinite where the odometry never moves
    apart: bool  # they differ by more than APART in most stretches of any length
    truth: float  # m from end to end of the path
    odometry: float


def ways(log: Log, truth: Truth) -> Ways | None:
    """Compares the ways; None with fewer than FEWEST true poses, or where neither path is longer than MOVING."""
    if truth.kind != "truth" or len(truth.t) < FEWEST:
        return None
    known, reckoned = truth.poses[:, :2], log.dead_reckoned()[_steps(log, truth), :2]
    sizes = [float(np.hypot(*np.ptp(path, axis=0))) for path in (known, reckoned)]
    if max(sizes) < MOVING:
        return None
    found = [_factor(known[ends], reckoned[ends]) for ends in _stretches(len(known) - 1)]
    farther, nearer = sum(factor > APART for factor in found), sum(factor < 1 / APART for factor in found)
    return Ways(float(np.median(found)), max(farther, nearer) >= MOST * len(found), *sizes)


def headings_known(log: Log, truth: Truth) -> bool:
    """False where the truth's headings cannot be the log's: they never turn, or are not those of path and odometry."""
    return not (never_turns(log, truth) or other_headings(log, truth))


def never_turns(log: Log, truth: Truth) -> bool:
    """True where the truth's heading never turns, as of one that is not filled in, though path and odometry do."""
    if truth.kind != "truth" or len(truth.t) < FEWEST or np.ptp(np.unwrap(truth.poses[:, 2])) > UNTURNED:
        return False
    turned = _turned(log)[_steps(log, truth)]
    if np.ptp(turned) < TURNING:
        return False
    return any(_follows(truth.poses[ends, :2], turned[ends]) for ends in _stretches(len(truth.t) - 1))


def other_headings(log: Log, truth: Truth) -> bool:
    """True where the true path bends as the odometry turns, but not as its headings do, or these are a constant off."""
    if truth.kind != "truth" or len(truth.t) <= STRETCHES[0] or never_turns(log, truth):
        return False
    steps, found = _steps(log, truth), list[bool]()
    turned, reckoned = _turned(log)[steps], log.dead_reckoned()[steps]
    headings = np.unwrap(truth.poses[:, 2])
    for ends in _stretches(len(truth.t) - 1):
        known, counted = truth.poses[ends], reckoned[ends]
        if not _follows(known[:, :2], turned[ends]):
            continue
        there, here = (np.diff(path[:, :2], axis=0) for path in (known, counted))
        apart = _angles(there) - known[:-1, 2] - _angles(here) + counted[:-1, 2]
        weight = np.minimum(np.hypot(*there.T), np.hypot(*here.T))
        mean = weight @ np.exp(1j * apart) / max(weight.sum(), 1e-300)
        aside = abs(mean) > ALIKE and abs(np.angle(mean)) > ASIDE
        found.append(aside or not _follows(known[:, :2], headings[ends]))
    return bool(np.ptp(turned) >= TURNING and len(found) > 1 and all(found))


def judges(log: Log, truth: Truth) -> bool:
    """True for exact truth that can be the log's: it tells if covariances are as stated."""
    return truth.exact and possible(log, truth)


def possible(log: Log, truth: Truth) -> bool:
    """True for a true path, of GPS too, that can be the log's: it tells what is far more off than that is itself."""
    return truth.kind == "truth" and headings_known(log, truth) and not other_ways(log, truth)


def other_ways(log: Log, truth: Truth) -> bool:
    """True where ways by truth and by odometry differ as by a unit; not where the odometry never moves."""
    found = ways(log, truth)
    return found is not None and found.apart and found.odometry >= MOVING


def _turned(log: Log) -> Array:
    """(n,) rad that the odometry has turned so far."""
    return np.concatenate(([0.0], np.cumsum(log.delta[1:, 2])))


def _angles(moved: Array) -> Array:
    return np.arctan2(moved[:, 1], moved[:, 0])


def _steps(log: Log, truth: Truth) -> Ints:
    """(m,) the steps of the true poses, whose times are those of the log; of others the nearest after, or the last."""
    return np.minimum(np.searchsorted(log.t, truth.t), len(log) - 1)


def _stretches(last: int) -> Iterator[Ints]:
    """Yields the ends of stretches of the rows from 0 to `last`; of a row each where there are few rows."""
    for parts in STRETCHES:
        if parts <= last or parts == STRETCHES[0]:
            yield np.linspace(0, last, min(parts, last) + 1).round().astype(np.int64)


def _follows(places: Array, turned: Array) -> bool:
    """Tells if the path through `places` (k, 2) bends as a robot does that has `turned` so far (k,), rad."""
    moved = np.diff(places, axis=0)
    bend = np.diff(_angles(moved))
    turn = np.diff((turned[1:] + turned[:-1]) / 2)
    far = np.hypot(*moved.T)
    weight = np.minimum(far[1:], far[:-1])
    return bool(weight @ (1 - np.cos(bend - turn)) < FOLLOWS * (weight @ (1 - np.cos(bend))))


def _factor(known: Array, reckoned: Array) -> float:
    """The median over stretches, by how far one goes there, of the straight ways on `known` over those `reckoned`."""
    far, near = (np.hypot(*np.diff(path, axis=0).T) for path in (known, reckoned))
    weight = far / max(far.sum(), 1e-300) + near / max(near.sum(), 1e-300)
    order = np.argsort(np.arctan2(far, near))
    total = np.cumsum(weight[order])
    k = order[np.searchsorted(total, total[-1] / 2)]
    return float(far[k] / near[k]) if near[k] > 0 else np.inf
