"""Truth that contradicts its log: a path, headings or landmarks in another frame, unit, numbering or time."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, wrap
from ...core.truth.doubts import judges
from ...core.truth.errors import rows_of, sighting_errors, standing
from ..measure.accuracy import align, aligned
from ..measure.landmark_places import comparable, elsewhere, placed
from ..measure.stated_noise import NAMED, squares_in, typical_scale
from ..systematic.motions_along import by_truth, far_out
from ..words.numerals import listed, number
from .fit import FAR, Fitted
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

ALL, FEW, FIT = 0.9, 0.34, 0.05
"""Share of a landmark's sightings that is far out where its true place is wrong, share of such landmarks at most, and
share of the others' sightings that is far out."""

FROM_TRUTH, OFTEN = 3.0, 0.4
"""Typical error from the truth over what is stated, and share that is far out, from which on the truth is another. With
published logs they are 1.2 and 0.06 at most."""

OTHER = 0.1
"""Share of stretches of time in which motions are far out from a path, from which on either is of another drive."""

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
    delay: float = 0.0  # s, of its clock


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
        return Said(delay=delay)
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
    found = placed(log, truth.poses, rows_of(truth.t, log.t), known=True) if len(truth.t) else None
    if found is not None:
        ids, xy = found.ids[~found.scattered], found.xy[~found.scattered]
    else:
        ids, xy = fit.landmarks.ids, fit.landmarks.xy
    row = rows_of(known.ids, ids)
    if (row >= 0).sum() < FEWEST_PLACES:
        return
    there, here = known.xy[row[row >= 0]], xy[row >= 0]
    if not (elsewhere(truth, found) if found is not None else onto(there, here).off > OFF):
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
    if found is not None and np.median(nearest) < RIGHT * _extent(here):
        yield "the true places of landmarks fit the sightings but have other ids"


def late(log: Log, truth: Truth, delays: Sequence[float]) -> Iterator[str]:
    """Says how late the truth's clock is by the stretches that tell, if sightings then fit the truth, too."""
    if not delays:
        return
    delay, side = float(np.median(delays)), "late" if np.median(delays) > 0 else "early"
    columns = *truth.poses[:, :2].T, np.unwrap(truth.poses[:, 2])
    t = truth.t[(truth.t + delay >= truth.t[0]) & (truth.t + delay <= truth.t[-1])]
    then = np.column_stack([np.interp(t + delay, truth.t, column) for column in columns])
    before, after = (_from(log, one) for one in (truth, truth._replace(t=t, poses=then)))
    if before is None or after is None or after < min(before, FROM_TRUTH):
        other = "late" if side == "early" else "early"
        yield (
            f"the truth fits the log's path if its clock is about {abs(delay):.2g} s {side}, or that of the sightings "
            f"as much {other}"
        )


def _from(log: Log, truth: Truth) -> float | None:
    """The typical error of sightings from a truth over what is stated; None of too few."""
    errors = sighting_errors(log, comparable(log, truth._replace(assigned=None)))
    return typical_scale(squares_in(errors, log.z_cov), 2) if len(errors.row) >= FEWEST else None


def of_sightings(log: Log, truth: Truth, fits: Sequence[tuple[Log, Fitted]] = ()) -> Iterator[str]:
    """Says that sightings which agree with one another are far from the truth, in standard deviations.

    The true path is at fault where it does not fit the motions, and the true places do fit the `fits` of stretches.
    """
    if not judges(log, truth):
        return
    given = truth._replace(assigned=None)
    right = comparable(log, given)
    errors = sighting_errors(log, right)
    if len(errors.row) < FEWEST:
        return
    squares, ids = squares_in(errors, log.z_cov), log.ids[errors.row]
    odd = _elsewhere(ids, squares > FAR) if right is given and truth.map is not None else ids[:0]
    if len(odd):
        names, one = listed([str(name) for name in odd.tolist()], NAMED), len(odd) == 1
        verb = "is not where its sightings have it" if one else "are not where their sightings have them"
        yield f"the true place{'s' * (not one)} of landmark{'s' * (not one)} {names} {verb}"
        return
    scale, far = typical_scale(squares, 2), float((squares > FAR).mean())
    if scale <= FROM_TRUTH and far <= OFTEN:
        return
    begun = (
        f"the sightings agree with one another, but from the truth they are typically {number(scale)} times what is "
        f"stated, and {number(100 * far)} % are far out:"
    )
    by_path = _from(log, truth._replace(map=None)) if right is given and truth.map is not None else None
    by_places = _from_places(fits, truth) if by_path is not None else None
    placed_well = by_places is not None and by_places < min(FROM_TRUTH, scale / 2)
    share, count = far_out(log, *by_truth(log, truth), FAR)
    if placed_well and share > OTHER:
        yield (
            f"{begun} the true path is less precise than the sensor, or of another drive: from it motions are far out "
            f"in {number(100 * share)} % of {count} stretches of time, and the true places of landmarks alone fit"
        )
        return
    if placed_well and by_path is not None and by_path < FROM_TRUTH:
        yield (
            f"{begun} the true path and the true places of landmarks do not belong together, as either alone fits: the "
            "path is of another drive, or less precise than the sensor, or the places are"
        )
        return
    if by_path is not None and by_path < FROM_TRUTH:
        yield f"{begun} the true places of landmarks are less precise than the sensor, as the true path alone fits"
        return
    yield (
        f"{begun} the true path is less precise than the sensor, is late, stands still at times, or is of another "
        "place on the robot or another drive"
    )


def _from_places(fits: Sequence[tuple[Log, Fitted]], truth: Truth) -> float | None:
    """The typical error of sightings from the true places over what is stated, the fits of stretches moved onto these.

    None where these tell too little.
    """
    known, squares = standing(truth), list[Array]()
    if known is None:
        return None
    for log, fit in fits:
        row = rows_of(known.ids, fit.landmarks.ids)
        if (row >= 0).sum() < FEWEST_PLACES:
            continue
        poses = aligned(align(fit.landmarks.xy[row >= 0], known.xy[row[row >= 0]]), fit.path)
        squares.append(squares_in(sighting_errors(log, Truth(log.t, poses, known)), log.z_cov))
    joined = np.concatenate(squares) if squares else np.zeros(0)
    return typical_scale(joined, 2) if len(joined) >= FEWEST else None


def _elsewhere(ids: Ints, far: NDArray[np.bool_]) -> Ints:
    """The few landmarks of whose sightings nearly all are far out, where those of the others fit."""
    names, of = np.unique(ids, return_inverse=True)
    odd = np.bincount(of, weights=far) > ALL * np.bincount(of)
    fits = bool(far[~odd[of]].mean() < FIT) if not odd.all() else False
    return names[odd] if fits and odd.sum() <= FEW * len(names) else names[:0]


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
