"""Faults of real robots that no stated covariance covers, applied to a simulated log.

The ground truth gives the error of every sighting, z - h(truth), and of every motion, delta - between(truth): it is
subtracted, scaled and added again, so that the clean log's errors reappear in the faulty one. The stated noise does not
change. Each kind of fault draws from a generator of its own: none affects the others, and a larger share of lost
sightings includes those of a smaller one.
"""

from dataclasses import dataclass, fields, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.elementary import hypot
from ...core.factors import UNKNOWN, Dataset, Log, Truth
from ...core.options import option
from ...core.se2 import Array, Ints, between, wrap
from ...core.truth.errors import difference, rows_of, sighted_from
from ..remarks import KIDNAPPED
from .kidnapping import kidnapped
from .moving import moved
from .outliers import swapped
from .slow import slowed
from .wheeled_robot import SLIP_MOST, slip_lengths

Bools = NDArray[np.bool_]
Column = TypeVar("Column", Array, Ints)

TRACK = 0.5  # m between the wheels, one of which slips


@dataclass(frozen=True)
class Faults:
    """Faults applied to a log, by default none; a simulated world's options inherit it."""

    sensor_scale: float = option(1.0, "sd of a sighting's errors, in stated sd", minimum=0.0, maximum=1000.0)
    odometry_scale: float = option(1.0, "sd of the odometry's errors, in stated sd", minimum=0.0, maximum=1000.0)
    tails: float | None = option(
        None,
        "degrees of freedom of Student-t errors with unchanged covariance; not given: normal",
        minimum=2.1,
        maximum=1e6,
    )
    correlated: float = option(
        0.0, "share of the variance of sightings that is correlated in time, per landmark", minimum=0.0, maximum=0.999
    )
    correlation_time: float = option(
        10.0, "time in which that correlation falls to 1 / e, s", minimum=0.01, maximum=1e5, beside="correlated"
    )
    stated: str = option(
        "own",
        "covariances stated: of each sighting's own error; thinned to what it adds to the landmark's earlier ones; or "
        "even, to the mean of that",
        choices=("own", "thinned", "even"),
        beside="correlated",
    )
    slip: float = option(0.0, "wheel slips per metre, not covered by the stated noise", minimum=0.0, maximum=5.0)
    missing: float = option(0.0, "share of lost sightings", minimum=0.0, maximum=1.0)
    gap: float = option(
        0.0, "share of the steps, in the middle of the log, without sightings", minimum=0.0, maximum=1.0
    )
    wrong_ids: float = option(0.0, "share of sightings with another landmark's id", minimum=0.0, maximum=0.5)
    clutter: float = option(0.0, "mean number of false sightings per step", minimum=0.0, maximum=100.0)
    clutter_ids: str = option(
        "unknown", "ids of false sightings: unknown, or a new id each (nobody)", choices=("unknown", "nobody")
    )
    jitter: float = option(0.0, "error of the time of a step's sightings, sd in s", minimum=0.0, maximum=60.0)
    moving: float = option(0.0, "share of the landmarks that move", minimum=0.0, maximum=1.0)
    motion: str = option(
        "velocity",
        "their motion: at constant speed, or with pauses",
        choices=("velocity", "stop-and-go"),
        beside="moving",
    )
    moving_speed: float = option(0.5, "their speed, m/s", minimum=0.0, maximum=50.0, beside="moving")
    roaming: float = option(
        2.0, "how far they go in x and in y before they turn back, m", minimum=0.01, maximum=1e4, beside="moving"
    )
    kidnap: float = option(0.0, "time at which the robot is put elsewhere on its way, s; 0: never", minimum=0.0)


class _Draws(NamedTuple):
    """One generator per kind of fault, assigned by order."""

    motions: np.random.Generator
    slips: np.random.Generator
    sightings: np.random.Generator
    moments: np.random.Generator
    ids: np.random.Generator
    missing: np.random.Generator
    clutter: np.random.Generator
    moving: np.random.Generator
    kidnap: np.random.Generator
    slow: np.random.Generator


def with_faults(dataset: Dataset, faults: Faults, rng: np.random.Generator) -> Dataset:
    """Applies the faults to the simulated `dataset`; without any, it is returned unchanged if all ranges are positive.

    Its ground truth must have a pose per step, and the map. The new one's `assigned` has the true ids if some have
    changed or sightings are false, whose true id is UNKNOWN. A sighting whose error makes its range zero or negative is
    lost, even without faults, as is that of a landmark that has moved out of view. The log's notes have the options,
    and counts, under "faults".
    """
    wanted = {field.name: value for field in fields(Faults) if (value := getattr(faults, field.name)) != field.default}
    log, truth = dataset
    if not wanted and (log.z[:, 0] > 0).all():
        return dataset
    if truth is None or truth.map is None or len(truth.t) != len(log):
        raise ValueError("faults need the true pose of every step")
    draws, counts = _Draws(*rng.spawn(len(_Draws._fields))), dict[str, int]()
    view = log.z
    if wanted.keys() & {"odometry_scale", "tails"}:
        log = _off(log, truth, faults.odometry_scale, faults.tails, draws.motions)
    if faults.slip:
        log, counts["slips"] = _slipped(log, truth, faults.slip, draws.slips)
    if faults.correlated:
        log = slowed(log, truth, faults.correlated, faults.correlation_time, faults.stated, draws.slow)
    if wanted.keys() & {"sensor_scale", "tails", "jitter"}:
        log = _missed(log, truth, faults, draws)
    in_view = np.ones(len(log.ids), bool)
    if faults.moving:
        log, truth, in_view = moved(
            log, truth, faults.moving, faults.motion, faults.moving_speed, faults.roaming, draws.moving
        )
        assert truth.moving is not None
        counts["moving landmarks"] = len(truth.moving)
    if faults.wrong_ids:
        log, truth = swapped(log, truth, faults.wrong_ids, draws.ids)
        assert truth is not None
    kept = (draws.missing.uniform(size=len(log.ids)) >= faults.missing) & (log.z[:, 0] > 0)
    kept &= in_view
    false = _clutter(log, view, faults.clutter, draws.clutter)
    blind = _gap(len(log), faults.gap)
    kept, false = kept & ~blind[log.sighting_step], false.only(~blind[false.step])
    if faults.clutter:
        counts["false sightings"] = len(false.step)
    if not kept.all():
        counts["sightings lost"] = int((~kept).sum())
    log, truth = _merged(log, truth, kept, false, faults.clutter_ids)
    if faults.kidnap:
        log, truth, counts[KIDNAPPED] = kidnapped(log, truth, faults.kidnap, draws.kidnap)
    return Dataset(replace(log, notes={**log.notes, "faults": wanted | counts}), truth)


def _scale(scale: float, tails: float | None, rows: int, rng: np.random.Generator) -> Array:
    """(rows,) factors on normal errors: a t is normal over the root of a chi-square of its own."""
    if tails is None:
        return np.full(rows, scale)
    return scale * np.sqrt((tails - 2) / rng.chisquare(tails, rows))


def _off(log: Log, truth: Truth, scale: float, tails: float | None, rng: np.random.Generator) -> Log:
    """The log with larger errors in its odometry."""
    right = between(truth.poses[:-1], truth.poses[1:])
    error = difference(log.delta[1:], right)
    return _with_motions(log, right + error * _scale(scale, tails, len(right), rng)[:, None])


def _slipped(log: Log, truth: Truth, rate: float, rng: np.random.Generator) -> tuple[Log, int]:
    """The log with slips in its odometry, a Poisson process of `rate` per metre along the true path; and their number.

    A wheel that spins or skids over some metres reads that much more or less than it rolled; a robot TRACK wide appears
    to have moved half of that and to have turned. The lengths are from `wheeled_robot.slipped`.
    """
    way = np.concatenate(([0.0], np.cumsum(hypot(*np.diff(truth.poses[:, :2], axis=0).T))))
    slips = int(rng.poisson(rate * way[-1]))
    step = np.minimum(np.searchsorted(way, rng.uniform(0, way[-1], slips), "right"), len(log) - 1)
    metres = np.minimum(slip_lengths(rng, slips), SLIP_MOST) * rng.choice([-1.0, 1.0], slips)
    side = rng.choice([-1.0, 1.0], slips)
    delta = log.delta.copy()
    delta[:, 0] += np.bincount(step, metres / 2, len(log))
    delta[:, 2] += np.bincount(step, side * metres / TRACK, len(log))
    return _with_motions(log, delta[1:]), slips


def _missed(log: Log, truth: Truth, faults: Faults, draws: _Draws) -> Log:
    """The log with larger errors in its sightings, those of a step taken with a common time error.

    Between steps the robot is assumed to move straight and evenly.
    """
    assert truth.map is not None
    ids = log.ids if truth.assigned is None else truth.assigned
    row = rows_of(truth.map.ids, ids)
    xy, step = truth.map.xy[row], log.sighting_step
    poses = truth.poses
    right = sighted_from(poses[step], xy)
    error = difference(log.z, right)
    if faults.jitter:
        moments = log.t + faults.jitter * draws.moments.standard_normal(len(log))
        columns = (*poses.T[:2], np.unwrap(poses[:, 2]))
        poses = np.stack([np.interp(moments, log.t, column) for column in columns], axis=-1)
        right = sighted_from(poses[step], xy)
    z = right + error * _scale(faults.sensor_scale, faults.tails, len(ids), draws.sightings)[:, None]
    z[:, 1] = wrap(z[:, 1])
    return replace(log, z=_frozen(np.where(row[:, None] >= 0, z, log.z)))


def _gap(steps: int, share: float) -> Bools:
    """(steps,) mask of the gap: that share of the steps, in the middle."""
    blind = np.zeros(steps, bool)
    wide = round(share * steps)
    first = (steps - wide) // 2
    blind[first : first + wide] = True
    return blind


class _False(NamedTuple):
    """False sightings."""

    step: Ints  # (m,) sorted
    z: Array  # (m, 2)
    cov: Array  # (m, 2, 2)

    def only(self, which: Bools) -> "_False":
        """A subset of them."""
        return _False(self.step[which], self.z[which], self.cov[which])


def _clutter(log: Log, view: Array, rate: float, rng: np.random.Generator) -> _False:
    """A Poisson number per step, of mean `rate`, anywhere in the field of view: the ranges and bearings of `view`.

    The positions are uniform in the plane; each has the covariance of the sighting with the nearest range.
    """
    ranged = view[:, 0] > 0
    view, cov = view[ranged], log.z_cov[ranged]
    step = np.repeat(np.arange(len(log)), rng.poisson(rate if len(view) else 0.0, len(log)))
    if not len(step):
        return _False(step, np.zeros((0, 2)), np.zeros((0, 2, 2)))
    (nearest, right), (farthest, left) = view.min(axis=0), view.max(axis=0)
    r = np.sqrt(rng.uniform(nearest**2, farthest**2, len(step)))
    order = np.argsort(view[:, 0])
    after = np.clip(np.searchsorted(view[order, 0], r), 1, len(view) - 1)
    closer = r - view[order[after - 1], 0] < view[order[after], 0] - r
    z = np.stack((r, rng.uniform(right, left, len(step))), axis=-1)
    return _False(step, z, cov[order[after - closer]])


def _merged(log: Log, truth: Truth, kept: Bools, false: _False, naming: str) -> tuple[Log, Truth]:
    """The log with the sightings `kept` and the false ones, in the order of their bearing."""
    if kept.all() and not len(false.step):
        return log, truth
    m = len(false.step)
    assert truth.map is not None
    nobody = 1 + max(log.ids.max(initial=0), truth.map.ids.max(initial=0)) + np.arange(m)
    new_ids = np.full(m, UNKNOWN) if naming == "unknown" else nobody
    step = np.concatenate((log.sighting_step[kept], false.step))
    z = np.concatenate((log.z[kept], false.z))
    order = np.lexsort((z[:, 1], step)) if m else np.arange(len(step))
    first = np.searchsorted(step[order], np.arange(len(log) + 1))
    if m or truth.assigned is not None:
        assigned = log.ids if truth.assigned is None else truth.assigned
        truth = truth._replace(assigned=_frozen(np.concatenate((assigned[kept], np.full(m, UNKNOWN)))[order]))
    return replace(
        log,
        sighting_first=_frozen(first),
        ids=_frozen(np.concatenate((log.ids[kept], new_ids))[order]),
        z=_frozen(z[order]),
        z_cov=_frozen(np.concatenate((log.z_cov[kept], false.cov))[order]),
    ), truth


def _with_motions(log: Log, delta: Array) -> Log:
    """The log with these motions (n - 1, 3), not wrapped yet."""
    moved = np.concatenate((log.delta[:1], delta))
    moved[1:, 2] = wrap(moved[1:, 2])
    return replace(log, delta=_frozen(moved))


def _frozen(column: Column) -> Column:
    column.flags.writeable = False
    return column
