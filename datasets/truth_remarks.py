"""Remarks on a log's ground truth: what it covers, and what of it cannot be that of the log."""

from collections.abc import Iterator
from math import log10

import numpy as np

from ..core.factors import UNKNOWN, Dataset, Log, Truth
from ..core.se2 import wrap
from ..core.truth_doubts import MOVING, Ways, headings_known, never_turns, other_headings, ways

COVERED = 0.75  # share of the steps; with a true pose at fewer, errors are of a part of the log
PARTIAL_NOTE = "truth"  # the key, among a log's notes, of words on a truth that is known to be of a part of it
UNITS = (
    (1000.0, "{} is in millimetres, or {} in kilometres"),
    (100.0, "{} is in centimetres"),
    (39.37, "{} is in inches"),
    (3.281, "{} is in feet"),
)
SPEEDS = (
    (3.6, "the odometry's speeds are in km/h", "the odometry's speeds were taken for km/h"),
    (
        2.0,
        "the odometry takes a wheel's diameter for its radius",
        "the odometry takes a wheel's radius for its diameter",
    ),
)
"""By how many times one goes farther than the other, and why: of speeds, where that is the odometry, and the truth."""
NEAR = 0.05  # of the logarithm to base 10 of a factor: within 12 % of it
UNLIKELY, FARTHEST, MOST_TURNED = 10.0, 1.0, 0.5
"""Standard deviations of the start, m, and rad: farther from the true one it is another."""
NO_UNIT = "a clock, a speed or the size of the wheels is wrong"


def of_truth(dataset: Dataset) -> Iterator[str]:
    """Compares a log with its ground truth."""
    log, truth = dataset
    if truth is None:
        return
    yield from _places(log, truth)
    if truth.kind != "truth" or not len(truth.t):
        return
    if truth.exact and len(truth.t) < COVERED * len(log) and PARTIAL_NOTE not in log.notes:
        yield (
            f"the truth is known at {len(truth.t)} of {len(log)} steps, from {_after(log, truth.t[0])} to "
            f"{_after(log, truth.t[-1])} s of {_after(log, log.t[-1])} s: errors are of these alone"
        )
    if never_turns(log, truth):
        yield (
            f"the truth's heading is always {truth.poses[0, 2]:.3g} rad, though its path turns as the odometry does: "
            "perhaps it is not filled in; no heading and no NEES is judged"
        )
    elif other_headings(log, truth):
        yield (
            "the true path bends as the odometry turns, but the truth's headings turn otherwise, or are a constant "
            "off: perhaps they are clockwise, from north, or of another frame; no heading and no NEES is judged"
        )
    found = ways(log, truth)
    if found is not None and found.apart:
        yield from _apart(log, found)
    else:
        yield from _elsewhere(log, truth)


def _elsewhere(log: Log, truth: Truth) -> Iterator[str]:
    """Compares the start with the truth at that time, where both are known."""
    if truth.t[0] != log.t[0] or log.prior.start != "known" or not truth.exact:
        return
    off, sd = truth.poses[0] - log.prior.pose, np.sqrt(np.diag(log.prior.cov))
    way, turn = float(np.hypot(off[0], off[1])), abs(float(wrap(off[2])))
    far = way > max(UNLIKELY * sd[:2].max(), FARTHEST)
    turned = turn > max(UNLIKELY * sd[2], MOST_TURNED) and headings_known(log, truth)
    if far or turned:
        yield (
            f"the log starts {way:.3g} m and {turn:.2g} rad from where the truth does, and that is stated to "
            f"{sd[:2].max():.2g} m and {sd[2]:.2g} rad: perhaps the given start (prior) is in another frame or unit; "
            "errors from the origin, and NEES, have the difference"
        )


def _places(log: Log, truth: Truth) -> Iterator[str]:
    """Compares the ids of known landmarks with those that are sighted."""
    ids = log.ids if truth.assigned is None else truth.assigned
    seen = np.unique(ids[ids != UNKNOWN])
    if truth.map is None or not len(truth.map.ids) or not len(seen) or np.isin(seen, truth.map.ids).any():
        return
    known = truth.map.ids
    yield (
        f"none of the {len(known)} landmarks with a known place (landmarks.csv), of ids from {known.min()} to "
        f"{known.max()}, is ever sighted: the ids of sightings are from {seen.min()} to {seen.max()}"
    )


def _after(log: Log, t: float) -> str:
    """The time since the log's first step, s."""
    return f"{t - log.t[0]:.4g}"


def _apart(log: Log, found: Ways) -> Iterator[str]:
    """Says by how much ways by truth and by odometry differ, and what has such a factor."""
    named = [("the truth", found.truth), ("the odometry", found.odometry)]
    (shorter, least), (longer, most) = sorted(named, key=lambda one: one[1])
    if least < MOVING:
        if shorter == "the odometry" and len(log.ids):
            return  # ranges tell if the robot drove: the truth of one that stands may wander, as by GPS
        yield (
            f"{shorter} stays within {least:.2g} m, where {longer} is of {most:.3g} m from end to end: perhaps its "
            "places are not filled in, or it is in kilometres"
        )
        return
    farther, other = ("the truth", "the odometry") if found.factor > 1 else ("the odometry", "the truth")
    times = max(found.factor, 1 / found.factor)
    causes = [(size, words.format(farther, other)) for size, words in UNITS]
    causes += [(size, by_truth if found.factor > 1 else by_odometry) for size, by_odometry, by_truth in SPEEDS]
    off = [(abs(log10(times / size)), words) for size, words in causes]
    near = [words for far, words in sorted(off) if far < NEAR]
    yield (
        f"between the same steps {farther} goes {times:{',.0f' if times >= 100 else '.3g'}} times as far as {other} "
        f"(median): perhaps {', or '.join(near) or NO_UNIT}"
    )
