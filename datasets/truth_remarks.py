"""Remarks on a log's ground truth: what it covers, and what of it cannot be that of the log."""

from collections.abc import Iterator
from math import log10

import numpy as np

from ..core.factors import UNKNOWN, Dataset, Log, Map, Truth
from ..core.se2 import Ints, wrap
from ..core.truth.doubts import MOVING, Ways, headings_known, never_turns, other_headings, ways

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
FEWEST_PLACES, LONE = 4, 2.0
"""Known places, and times their extent and the longest range, from which on the nearest other one is too far."""
NAMED = 5  # ids that a remark names
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
    """Compares the ids of known landmarks with those that are sighted, and their places with one another."""
    ids = np.concatenate((_whole(log, truth), _alone_ids(log, truth)))
    ids = ids[ids != UNKNOWN]
    if truth.map is None or not len(truth.map.ids) or truth.places != "truth":
        return
    known, seen = truth.map.ids, np.unique(ids)
    if len(seen) and not np.isin(seen, known).any():
        yield (
            f"none of the {len(known)} landmarks with a known place (landmarks.csv), of ids from {known.min()} to "
            f"{known.max()}, is ever sighted: the ids of sightings are from {seen.min()} to {seen.max()}"
        )
    elif not np.isin(seen, known).all():
        without, never = seen[~np.isin(seen, known)], known[~np.isin(known, seen)]
        one = len(without) == 1
        yield (
            f"{len(without)} of the {len(seen)} ids that are sighted {'has' if one else 'have'} no known place "
            f"(landmarks.csv), {_named(without)}, with {int(np.isin(ids, without).sum()):,} of {len(ids):,} sightings"
            + (
                f"; {len(never)} of those with a place {'is' if len(never) == 1 else 'are'} never sighted, "
                f"{_named(never)}"
            )
            * bool(len(never))
        )
    yield from _alone(log, truth.map)


def _whole(log: Log, truth: Truth) -> Ints:
    """(s,) the ids of whole sightings."""
    return log.ids if truth.assigned is None else truth.assigned


def _alone_ids(log: Log, truth: Truth) -> Ints:
    """(p,) those of ranges and bearings alone."""
    if log.partial is None:
        return np.zeros(0, np.int64)
    return log.partial.ids if truth.assigned_partial is None else truth.assigned_partial


def _alone(log: Log, known: Map) -> Iterator[str]:
    """Finds a place so far from all others that no sighting can join it with them."""
    if len(known.ids) < FEWEST_PLACES or not len(log.z):
        return
    off = np.hypot(*(known.xy - np.median(known.xy, axis=0)).T)
    one = int(np.argmax(off))
    others = np.delete(known.xy, one, axis=0)
    gap, size = float(np.hypot(*(others - known.xy[one]).T).min()), float(np.hypot(*np.ptp(others, axis=0)))
    farthest = float(log.z[:, 0].max())
    if gap > LONE * (size + farthest):
        yield (
            f"the known place of landmark {known.ids[one]} (landmarks.csv) is {gap:.3g} m from all others, which are "
            f"within {size:.3g} m of one another, and no range is longer than {farthest:.3g} m: perhaps it is in "
            "another unit, or of elsewhere"
        )


def _named(ids: Ints) -> str:
    """The first ids."""
    more = f" and {len(ids) - NAMED:,} more" if len(ids) > NAMED else ""
    return ", ".join(map(str, ids[:NAMED].tolist())) + more


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
