"""Drives whose speeds change all the time, as rows of mean speeds at any rate, with white noise along the way."""

from typing import Literal, NamedTuple

import numpy as np

from slamduel.core.factors import Odometry
from slamduel.core.se2 import Array, between, compose, compose_jacobians, summed, wrap
from slamduel.frontend.wheels.encoder import Floors, roll
from slamduel.frontend.wheels.held import Held, way
from slamduel.frontend.wheels.track import TrackNoise

DT = 0.01  # s, of the drive itself
SECONDS = 60.0

NOISE = TrackNoise(0.05, 0.03, 0.05, Floors(1e-3, 1e-3))

Kind = Literal["circle", "slalom", "stops", "wander"]


class Drive(NamedTuple):
    """A drive and its odometry."""

    poses: Array  # (n, 3) at multiples of DT
    t: Array  # (m,) s, of the rows
    rates: Array  # (m, 2) m/s and rad/s, the means until the next row; the last one is not used
    instant: Array  # (m, 2) those at the row's time, with the noise of these means


def speeds(kind: Kind, rng: np.random.Generator) -> Array:
    """(n, 2) true speeds, m/s and rad/s, at multiples of DT."""
    t: Array = DT * np.arange(float(round(SECONDS / DT)))
    if kind == "circle":
        return np.tile([0.5, 0.4], (len(t), 1))
    if kind == "slalom":  # weaves with a period of 8 s
        return np.column_stack((np.full_like(t, 0.6), 0.6 * np.sin(2 * np.pi * t / 8 + rng.uniform(0, 6))))
    if kind == "stops":  # 6 s ahead and 3.4 s of turning on the spot, with ramps of 0.7 and 0.5 s
        since = (t + rng.uniform(0, 10)) % 10
        ahead = 0.5 * np.clip(np.minimum(since, 6 - since) / 0.7, 0, 1)
        turning = 0.7 * np.clip(np.minimum(since - 6.3, 9.7 - since) / 0.5, 0, 1)
        return np.column_stack((ahead, turning * np.where(t // 10 % 2, -1, 1)))
    knots = 2.0 * np.arange(SECONDS / 2 + 2)  # other speeds every 2 s, gathered over a second
    drawn = np.stack((rng.uniform(0.1, 0.9, len(knots)), rng.normal(0, 0.5, len(knots))))
    fine = DT * np.arange(len(t) + 99)
    return np.column_stack([np.convolve(np.interp(fine, knots, one), np.full(100, 0.01), "valid") for one in drawn])


def driven(kind: Kind, seed: int, hz: int) -> Drive:
    """A drive with rows at `hz`; the same drive with the same noise at each rate, of NOISE."""
    rng = np.random.default_rng([seed, len(kind), ord(kind[0])])
    true = speeds(kind, rng)
    moved = true * DT
    turn = np.sqrt(NOISE.turning**2 * np.abs(moved[:, 0]) + NOISE.turning_by_turn**2 * np.abs(moved[:, 1]))
    sd = np.column_stack((NOISE.forward * np.sqrt(np.abs(moved[:, 0])), turn))
    error = sd * rng.standard_normal(moved.shape)
    each = round(1 / hz / DT)
    rows = len(moved) // each
    off = error[: rows * each].reshape(rows, each, 2).sum(axis=1) * hz
    mean = true[: rows * each].reshape(rows, each, 2).mean(axis=1)
    rates, instant = (np.concatenate((one + off, true[-1:] + off[-1:])) for one in (mean, true[: rows * each : each]))
    return Drive(summed(np.zeros(3), roll(moved, "arc")[0]), np.arange(rows + 1) / hz, rates, instant)


def track(t: Array, rates: Array, noise: TrackNoise = NOISE, *, sudden: bool = False) -> Held:
    """The rows as a track."""
    along = way(t, rates, "cart")
    return Held(along.t, along.poses, noise, 50.0, "cart", rates=rates, rows=along.rows, sudden=sudden)


def single_nees(found: Odometry, true: Array) -> Array:
    """(n,) NEES over its 3 degrees of freedom of the motions between the true poses (n + 1, 3)."""
    error = found.delta - between(true[:-1], true[1:])
    error[:, 2] = wrap(error[:, 2])
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.cov), error) / 3


def reckoned_nees(found: Odometry, true: Array) -> Array:
    """(n,) NEES over its 3 degrees of freedom of dead reckoning from the first of the true poses (n + 1, 3)."""
    pose, cov, values = true[0], np.zeros((3, 3)), list[float]()
    for delta, delta_cov, there in zip(found.delta, found.cov, true[1:], strict=True):
        by_pose, by_delta = compose_jacobians(pose, delta)
        cov = by_pose @ cov @ by_pose.T + by_delta @ delta_cov @ by_delta.T
        pose = compose(pose, delta)
        error = pose - there
        error[2] = wrap(error[2])
        values.append(float(error @ np.linalg.solve(cov, error)) / 3)
    return np.array(values)


def nees(drive: Drive, every: float, rates: Array, *, sudden: bool = False) -> Array:
    """(2,) mean NEES of single steps of `every` s and of dead reckoning by them, with `rates` held."""
    at = every * np.arange(np.floor(drive.t[-1] / every + 1e-9) + 1)
    found = track(drive.t, rates, sudden=sudden).motions(at)
    true = drive.poses[np.rint(at / DT).astype(int)]
    return np.array([single_nees(found, true).mean(), reckoned_nees(found, true).mean()])
