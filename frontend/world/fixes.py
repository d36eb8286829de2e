"""Places positions and headings at the steps of a log, as fixes: factors beside all others.

What carries what, so that no measurement counts twice: the log's odometry, sightings and loops are what they were; a
position or a heading is in one fix. One that was measured between two steps becomes a fix of the nearer one: the
motion from there, by the wheels, moves the antenna on the robot, (p + R (d + R_d a)), and turns a heading. What that
motion is unsure of is added to the fix's covariance. Odometry that is made of the same measurements is refused.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Log
from ...core.fixes import FixTable
from ...core.se2 import Array, Ints, act, between, compose, inverse, rotation, wrap
from ..wheels.holes import outside
from ..wheels.motion import Drift, Motion
from .measured import Measured

NOTE = "fixes"
"""The number of positions and headings among a log's notes."""

SAME = 1e-9
"""s between a measurement and a step of one time."""

NONE_OF_ITS_OWN = 1e-3, 1e-4
"""m and rad, by which, in the median, an odometry's ways and turns differ from those between the fixes that it is made
of."""

MOVED, FEW = (0.1, 0.02), 10
"""m and rad, in the median, that the robot moved between fixes, and the number of them, to tell so."""


class Moved(NamedTuple):
    """The motion from a step to a measurement."""

    delta: Array  # (3,)
    cov: Array  # (3, 3)


def with_fixes(log: Log, found: Measured, motion: Motion | None, first: int = 0) -> tuple[Log, list[str]]:
    """The log with fixes at its steps from `first` on, and remarks.

    `motion` is that of the wheels; without one the log's own odometry tells what is between its steps. InputError for
    odometry that is made of these measurements.
    """
    t = log.t[first:]
    here = (t[0] <= found.t) & (found.t <= t[-1])
    remarks = list[str]()
    for noun, own in (("position", found.placed), ("heading", ~found.placed)):
        lost = int((own & ~here).sum())
        remarks += outside(
            log.name, lost, int(own.sum()), noun, f"before or after its steps, {t[0]:.10g} to {t[-1]:.10g} s"
        )
    kept = found.taken(here)
    if not len(kept.t):
        return log, remarks
    _check_its_own(log, kept, motion)
    step = nearest(t, kept.t) + first
    order = np.argsort(step, kind="stable")
    kept, step = kept.taken(order), step[order]
    z, cov, arm = kept.z.copy(), kept.cov.copy(), kept.arm.copy()
    for row, (k, at) in enumerate(zip(step.tolist(), kept.t.tolist(), strict=True)):
        if abs(at - log.t[k]) <= SAME:
            continue
        moved = motion_from(log, k, at, motion)
        arm[row] = act(moved.delta, arm[row])
        z[row, 2] = wrap(z[row, 2] - moved.delta[2])  # NaN of a position
        lever = rotation(float(moved.delta[2]))[:2, :2] @ (-kept.arm[row, 1], kept.arm[row, 0])
        by_turn = np.column_stack((np.eye(2), lever))
        most = float(np.linalg.eigvalsh(by_turn @ moved.cov @ by_turn.T)[-1])
        cov[row] += np.diag([most, most, moved.cov[2, 2]])
    count = {"positions": int(kept.placed.sum()), "headings": int((~kept.placed).sum())}
    fixes = FixTable.from_arrays(len(log), step, z, cov, arm)
    return replace(log, fixes=fixes, notes={**log.notes, NOTE: count}), remarks


def nearest(t: Array, at: Array) -> Ints:
    """(f,) the index of the time in `t` (n,) that is nearest to each of `at` (f,)."""
    after = np.clip(np.searchsorted(t, at), 1, max(len(t) - 1, 1)) % len(t)
    before = np.maximum(after - 1, 0)
    return np.where(at - t[before] <= t[after] - at, before, after)


def motion_from(log: Log, k: int, at: float, motion: Motion | None) -> Moved:
    """The motion from step k to the time `at`, s, within half a step before it or after it."""
    start, back = float(log.t[k]), at < log.t[k]
    if (
        motion is not None
        and not isinstance(motion, Drift)
        and motion.t[0] <= min(start, at) <= max(start, at) <= motion.t[-1]
    ):
        delta, cov = motion.odometry(min(start, at), max(start, at))
    else:
        row = k if back else k + 1
        share = (at - start) / (log.t[row] - log.t[row - 1])
        delta, cov = abs(share) * log.delta[row], abs(share) * log.delta_cov[row]
    if not back:
        return Moved(delta, cov)
    return Moved(inverse(delta), cov)


def _check_its_own(log: Log, found: Measured, motion: Motion | None) -> None:
    """Raises InputError where the odometry is made of these positions or headings."""
    for own, column, noun, sensor in (
        (found.placed, slice(0, 2), "ways", "positions"),
        (~found.placed, 2, "turns", "headings"),
    ):
        of = found.taken(own)
        if len(of.t) < FEW or isinstance(motion, Drift):
            continue
        path = path_at(log, of.t, motion)
        if column == 2:
            mine, other = (np.abs(wrap(np.diff(one))) for one in (path[:, 2], of.z[:, 2]))
            least, moved = NONE_OF_ITS_OWN[1], MOVED[1]
        else:
            mine, other = (np.hypot(*np.diff(one, axis=0).T) for one in (act(path, of.arm), of.z[:, :2]))
            least, moved = NONE_OF_ITS_OWN[0], MOVED[0]
        off = float(np.median(np.abs(mine - other)))
        if float(np.median(mine)) > moved and off < least:
            unit = "rad" if column == 2 else "m"
            raise InputError(
                f"{log.name}: the odometry's {noun} between {sensor} in the world differ from theirs by {off:.2g} "
                f"{unit} (median), expected more than {least:g}: it is made of these {sensor}, which would count "
                "twice; expected the odometry of wheels, or sensors without these."
            )


def path_at(log: Log, at: Array, motion: Motion | None) -> Array:
    """(f, 3) the poses at `at` (f,), s, by the odometry, from the log's first step on."""
    path = np.zeros((len(log), 3))
    for k in range(1, len(log)):
        path[k] = compose(path[k - 1], log.delta[k]) if np.isfinite(log.delta[k]).all() else path[k - 1]
    step = nearest(log.t, at)
    ends = [
        np.zeros(3) if abs(time - log.t[k]) <= SAME else motion_from(log, k, time, motion).delta
        for k, time in zip(step.tolist(), at.tolist(), strict=True)
    ]
    return compose(path[step], np.array(ends).reshape(-1, 3))


def ways(path: Array) -> Array:
    """(f - 1,) m between consecutive poses of a path."""
    return np.hypot(*between(path[:-1], path[1:])[:, :2].T)


def about(told: dict[str, Any]) -> str:
    """The counts in words."""
    return ", ".join(f"{n} {name}" for name, n in told.items() if n)
