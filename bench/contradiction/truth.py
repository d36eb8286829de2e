"""Truth that contradicts its log: a path, headings or landmarks in another frame, unit, numbering or time."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, wrap
from ...core.truth_doubts import judges
from ...core.truth_errors import rows_of, sighting_errors, standing
from ..measure.landmark_places import comparable, placed
from ..measure.stated_noise import noise_check
from ..words.numerals import listed, number
from .fit import Fitted
from .mistakes import FACTORS, LENGTHS

FEWEST, FEWEST_PLACES = 8, 5
"""Poses of a stretch, and landmarks, that are compared."""

OFF, RIGHT = 0.3, 0.06
"""Root mean square distance over that from the middle: from the one on a path or map is another, up to the other the
same. The optimum of a stretch is right to 0.01."""

TURNED = 0.5
"""rad; a median error of the truth's headings, from which on they are others than the robot's."""

STEADY = 0.98
"""Mean resultant length of angles that are one but for 0.2 rad."""

APART, ELSEWHERE = 0.1, 10.0
"""Distance over that from the middle, and over the median distance, beyond which a single landmark is elsewhere."""

FROM_TRUTH, OFTEN = 3.0, 0.25
"""Typical error from the truth over what is stated, and share that is far out, from which on the truth is another. With
published logs they are 1.2 and 0.06 at most."""

NAMED = 6
"""Landmarks that are named one by one."""

DELAYS = (-10.0, -5.0, -2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
"""s; a clock's delay is looked for between two of them."""

NEARER, NOTICED = 3.0, 0.05
"""Times as near to the path as without a delay, and the least delay, s, that is named."""


class Moved(NamedTuple):
    """Points moved onto others."""

    angle: float  # rad, they were turned by
    off: float  # root mean square distance over that of the others from their middle


class Said(NamedTuple):
    """The mistakes in the truth of a stretch, in words; "" for none."""

    path: str = ""
    headings: str = ""


def of_path(log: Log, fit: Fitted, truth: Truth) -> Said:
    """Says what is wrong with the true path of a stretch, or with its headings."""
    row = rows_of(truth.t, log.t)
    known = row >= 0
    if known.sum() < FEWEST:
        return Said()
    path, poses = fit.path[known], truth.poses[row[known]]
    moved = onto(poses[:, :2], path[:, :2])
    if moved.off > OFF and onto(poses[:, [1, 0]], path[:, :2]).off < RIGHT:
        return Said("the truth is the mirror image of the log's path: x and y are swapped, or one has the other sign")
    delay, off = _delay(log.t[known], path[:, :2], truth)
    if off < min(RIGHT, moved.off / NEARER) and abs(delay) > NOTICED:
        side = "late" if delay > 0 else "early"
        return Said(f"the truth fits the log's path if its clock is about {abs(delay):.2g} s {side}")
    if moved.off < OFF:
        return Said(headings=_of_headings(wrap(poses[:, 2]), path[:, 2], moved.angle))
    return Said()


def _delay(t: Array, path: Array, truth: Truth) -> tuple[float, float]:
    """The delay (s) of the truth's clock with which it is nearest to a path (n, 2) at times t (n,), and how near."""

    def off(delay: float) -> float:
        within = (t + delay >= truth.t[0]) & (t + delay <= truth.t[-1])
        if within.sum() < FEWEST:
            return np.inf
        then = np.column_stack([np.interp(t[within] + delay, truth.t, truth.poses[:, k]) for k in (0, 1)])
        return onto(then, path[within]).off

    best = int(np.argmin([off(delay) for delay in DELAYS]))
    if not 0 < best < len(DELAYS) - 1:
        return DELAYS[best], off(DELAYS[best])
    found: Any = minimize_scalar(off, bounds=(DELAYS[best - 1], DELAYS[best + 1]), method="bounded")
    return float(found.x), float(found.fun)


def _of_headings(told: Array, right: Array, angle: float) -> str:
    if np.median(np.abs(wrap(told + angle - right))) < TURNED or np.ptp(np.unwrap(right)) < TURNED:
        return ""
    for words, off in (
        ("turned by a constant of about {:.0f} degrees from the robot's", wrap(told + angle - right)),
        ("clockwise, as a compass's", wrap(told - angle + right)),
    ):
        mean = np.exp(1j * off).mean()
        if abs(mean) > STEADY:
            return f"the headings of the truth are {words.format(10 * np.rint(np.rad2deg(np.angle(mean)) / 10))}"
    return ""


def of_map(log: Log, truth: Truth, fit: Fitted) -> Iterator[str]:
    """Yields what is wrong with the true places of landmarks, by where sightings have them from the true path.

    Without one, by where the fit of a stretch has them; then another frame is none.
    """
    known = standing(truth)
    if known is None:
        return
    if len(truth.t):
        found = placed(log, truth.poses, rows_of(truth.t, log.t), known=True)
        ids, xy = found.ids[~found.scattered], found.xy[~found.scattered]
    else:
        ids, xy = fit.landmarks.ids, fit.landmarks.xy
    row = rows_of(known.ids, ids)
    if (row >= 0).sum() < FEWEST_PLACES:
        return
    there, here = known.xy[row[row >= 0]], xy[row >= 0]
    off = _typical(there - here, here) if len(truth.t) else onto(there, here).off
    if off < OFF:
        if len(truth.t):
            yield from _elsewhere(ids[row >= 0], there - here, here)
        return
    frame = "another frame than the true path, by a turn and a shift"
    for words, changed in (
        (f"in {frame}", there),
        ("mirrored: x and y are swapped, or one has the other sign", there[:, ::-1]),
        *((f"in {FACTORS[factor]}", there / factor) for factor in LENGTHS),
    ):
        if onto(changed, here).off < RIGHT:
            yield f"the true places of landmarks are {words}"
            return
    nearest = np.hypot(*(here[:, None] - known.xy[None]).transpose(2, 0, 1)).min(axis=1)
    if len(truth.t) and np.median(nearest) < RIGHT * _extent(here):
        yield "the true places of landmarks fit the sightings but have other ids"


def _elsewhere(ids: Ints, off: Array, among: Array) -> Iterator[str]:
    """Names the few landmarks whose places are far off (n, 2) where those of the others are right."""
    far = np.hypot(*off.T)
    odd = far > max(APART * _extent(among), ELSEWHERE * float(np.median(far)))
    if odd.any():
        names, one = listed([str(name) for name in ids[odd].tolist()], NAMED), odd.sum() == 1
        verb = "is not where its sightings have it" if one else "are not where their sightings have them"
        yield f"the true place{'s' * (not one)} of landmark{'s' * (not one)} {names} {verb}"


def of_sightings(log: Log, truth: Truth) -> Iterator[str]:
    """Says that sightings which agree with one another are far from the truth, in standard deviations."""
    if not judges(log, truth):
        return
    errors = sighting_errors(log, comparable(log, truth._replace(assigned=None)))
    check = noise_check(errors, log.z_cov[errors.row])
    if check is not None and check.checked >= FEWEST and (check.scale > FROM_TRUTH or check.far > OFTEN):
        yield (
            f"the sightings agree with one another, but from the truth they are typically {number(check.scale)} times "
            f"what is stated, and {number(100 * check.far)} % are far out: it is late, stands still at times, or is of "
            "another place on the robot or another drive"
        )


def _typical(off: Array, among: Array) -> float:
    """Median length of the rows (n, 2) over the size of what they are of."""
    size = _extent(among)
    return float(np.median(np.hypot(*off.T))) / size if size else 0.0


def _extent(xy: Array) -> float:
    """Root mean square distance (m) of points (n, 2) from their middle."""
    return float(np.sqrt(((xy - xy.mean(axis=0)) ** 2).sum(axis=1).mean()))


def onto(points: Array, others: Array) -> Moved:
    """Turns and moves points (n, 2) onto others, without a scale, by least squares."""
    a, b = points - points.mean(axis=0), others - others.mean(axis=0)
    dot, cross = (a * b).sum(), (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    angle = float(np.arctan2(cross, dot))
    c, s = np.cos(angle), np.sin(angle)
    turned = a @ np.array([[c, s], [-s, c]])
    size = _extent(b)
    off = float(np.sqrt(((turned - b) ** 2).sum(axis=1).mean()))
    return Moved(angle, off / size if size else 0.0)
