"""Draws measurements from the noise they state, for the worlds without a camera."""

from itertools import chain, pairwise

import numpy as np

from ...core.arrays import slices
from ...core.elementary import hypot
from ...core.factors import Prior
from ...core.se2 import Array, Ints, between, wrap
from ...core.small_matrices import cholesky, product
from ...core.truth.errors import sighted_from
from ...frontend.wheels.encoder import Encoder, Floors, roll
from ...frontend.wheels.ticks import Ticks, readings

START_SD = 1e-3  # m and rad, of the prior; the initial estimate has such an error

FLOORS = Floors(1e-4, 1e-5)
"""Makes a rolling robot's odometry positive definite: it cannot slide sideways."""


def prior(start: Array, rng: np.random.Generator) -> Prior:
    """A prior of the pose `start` (3,), with an error drawn from its covariance."""
    pose = start + START_SD * rng.standard_normal(3)
    pose[2] = wrap(pose[2])
    return Prior(pose, START_SD**2 * np.eye(3))


def odometry(poses: Array, rolling: Array, sd: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Odometry along the true `poses` (n, 3): deltas (n, 3) and covariances (n, 3, 3), row 0 unused.

    `rolling` (n - 1, 2) is the distance (m) and turn (rad) from each pose to the next; the readings of both have noise
    `sd` (2,) or (n - 1, 2), which an arc propagates to the body frame: C = J diag(sd^2) J' plus the floors. The errors
    are normal, of exactly that covariance.
    """
    _, by_rolling = roll(rolling, "arc")
    by_noise = by_rolling * np.broadcast_to(sd, rolling.shape)[:, None, :]
    cov = product(by_noise, by_noise.swapaxes(1, 2)) + FLOORS.cov
    error = product(cholesky(cov), rng.standard_normal((len(rolling), 3, 1)))
    delta = between(poses[:-1], poses[1:]) + error[..., 0]
    delta[:, 2] = wrap(delta[:, 2])
    return np.concatenate((np.zeros((1, 3)), delta)), np.concatenate((np.zeros((1, 3, 3)), cov))


def counted(ticks: Ticks, encoder: Encoder, t: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Odometry from a robot's wheel counters between the times `t` (n,): deltas (n, 3), covariances (n, 3, 3).

    Row 0 is unused. The floors' errors, which the counters do not have, are drawn here.
    """
    delta, cov = np.zeros((len(t), 3)), np.zeros((len(t), 3, 3))
    for k, (start, end) in enumerate(pairwise(t.tolist()), start=1):
        delta[k], cov[k] = encoder.odometry(*readings(ticks, start, end))
    delta[1:] += np.sqrt(np.diag(encoder.floors.cov)) * rng.standard_normal((len(t) - 1, 3))
    delta[:, 2] = wrap(delta[:, 2])
    return delta, cov


def in_reach(poses: Array, xy: Array, nearest: float, farthest: float) -> tuple[Ints, Ints]:
    """Landmarks of `xy` (n, 2) between two distances, m, of each pose: the steps and the rows of `xy`.

    Sorted by step, then by row. Found by a tree, at a cost proportional to the result.
    """
    from scipy.spatial import KDTree

    tree, steps, rows = KDTree(xy), list[Ints](), list[Ints]()
    for some in slices(len(poses)):
        found = tree.query_ball_point(poses[some, :2], farthest, return_sorted=True)
        step = np.repeat(np.arange(some.start, some.stop), [len(one) for one in found])
        row = np.fromiter(chain.from_iterable(found), np.int64, len(step))
        far_enough = hypot(*(xy[row] - poses[step, :2]).T) >= nearest
        steps.append(step[far_enough])
        rows.append(row[far_enough])
    return np.concatenate(steps), np.concatenate(rows)


def sightings(poses: Array, xy: Array, sd: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Range and bearing (s, 2) of the landmarks `xy` (s, 2) from the true `poses` (s, 3), and covariances (s, 2, 2).

    A landmark's position has noise `sd` m along the line of sight and across it: in bearing sd / r.
    """
    r = hypot(*(xy - poses[:, :2]).T)
    return polar(poses, xy, np.stack((np.full_like(r, sd), sd / r), axis=-1), rng)


def polar(poses: Array, xy: Array, sd: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """As `sightings`, with the standard deviations `sd` (2,) or (s, 2) of range (m) and bearing (rad)."""
    spread = np.broadcast_to(sd, xy.shape)
    z = sighted_from(poses, xy) + spread * rng.standard_normal(xy.shape)
    z[:, 1] = wrap(z[:, 1])
    cov = np.zeros((len(xy), 2, 2))
    cov[:, [0, 1], [0, 1]] = spread**2
    return z, cov
