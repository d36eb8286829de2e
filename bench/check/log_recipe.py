"""Makes a log from given motions, landmarks, sensor range and errors."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core import se2
from ...core.factors import Log, Map, Prior
from ...core.se2 import Array, Ints
from .small_logs import CIRCLE_START, IDS, INDOORS, MOTION_SD, PRIOR_SD, RING, SIGHTING_SD, SmallLog, around


def made_log(
    rng: np.random.Generator,
    motions: Array | None = None,
    *,
    start: ArrayLike = CIRCLE_START,
    xy: ArrayLike = RING,
    ids: Ints = IDS,
    reach: float = INDOORS,
    sees: ArrayLike = True,
    prior_sd: ArrayLike = PRIOR_SD,
    motion_sd: ArrayLike = MOTION_SD,
    sighting_sd: ArrayLike = SIGHTING_SD,
    correlation: float = 0.3,
    errors: float = 1.0,
    start_errors: float = 1.0,
    t: ArrayLike | None = None,
    known_sd: float | None = None,
) -> SmallLog:
    """Makes the log of a robot with `motions` (n - 1, 3), by default sixty steps of a circle, from about `start` (3,).

    Landmark `ids[i]` at `xy[i]` (L, 2) is sighted at step k where it is within `reach` (m) and `sees`, which broadcasts
    to (n, L), says so. Every error is drawn from the covariance that the log states, times `errors`, and that of the
    start times `start_errors` as well: `motion_sd` broadcasts to (n - 1, 3), `sighting_sd` to (n, L, 2), and
    `correlation` is that of any two components of an odometry delta, and of range and bearing. `t` (n,) are the times
    (s), by default 0.1 s apart. `known_sd` gives the robot the map, drawn with that standard deviation (m), or the true
    one, held fixed, where it is 0.
    """
    motions = around(60) if motions is None else motions
    n, places = len(motions) + 1, np.asarray(xy, float)
    landmarks = len(places)
    ids = ids[:landmarks] if landmarks <= len(ids) else np.arange(landmarks)
    beginning, off = np.asarray(start, float), errors * start_errors * np.broadcast_to(np.asarray(prior_sd, float), 3)
    pose = beginning + off * rng.standard_normal(3)
    pose[2] = se2.wrap(pose[2])
    poses = [pose]
    for motion in motions:
        poses.append(se2.compose(poses[-1], motion))
    path = np.array(poses)

    motion_cov, motion_root = _correlated(np.broadcast_to(np.asarray(motion_sd, float), (n - 1, 3)), correlation)
    delta = motions + errors * np.einsum("kij,kj->ki", motion_root, rng.standard_normal((n - 1, 3)))
    delta[:, 2] = se2.wrap(delta[:, 2])

    dx, dy = (places - path[:, None, :2]).transpose(2, 0, 1)
    exact = np.stack((np.hypot(dx, dy), np.arctan2(dy, dx) - path[:, None, 2]), axis=-1)  # (n, L, 2)
    seen: NDArray[np.bool] = (exact[..., 0] < reach) & np.broadcast_to(np.asarray(sees, bool), (n, landmarks))
    step, landmark = np.nonzero(seen)
    z_sd = np.broadcast_to(np.asarray(sighting_sd, float), (n, landmarks, 2))[seen]
    z_cov, z_root = _correlated(z_sd, correlation)
    z = exact[seen] + errors * np.einsum("kij,kj->ki", z_root, rng.standard_normal((len(step), 2)))
    z[:, 0] = np.abs(z[:, 0])  # a range is positive, whatever its noise
    z[:, 1] = se2.wrap(z[:, 1])

    known = None
    if known_sd is not None:
        drawn = places + known_sd * rng.standard_normal(places.shape)
        known = Map(ids, drawn, known_sd**2 * np.eye(2 * landmarks) if known_sd else None)
    prior = Prior(beginning, np.diag(np.broadcast_to(np.asarray(prior_sd, float), 3) ** 2), known)
    times = np.asarray(0.1 * np.arange(n) if t is None else t, np.float64)
    delta, delta_cov = np.vstack((np.zeros((1, 3)), delta)), np.concatenate((np.zeros((1, 3, 3)), motion_cov))
    log = Log.from_arrays("adversarial", prior, times, delta, delta_cov, step, ids[landmark], z, z_cov)
    return SmallLog(log, path, Map(ids, places, None))


def _correlated(sd: Array, correlation: float) -> tuple[Array, Array]:
    """Returns covariances (m, k, k) with standard deviations `sd` (m, k) and one correlation, and Cholesky factors."""
    shape = np.full((sd.shape[1], sd.shape[1]), correlation)
    np.fill_diagonal(shape, 1.0)
    scale = sd[:, :, None] * sd[:, None, :]
    return scale * shape, sd[:, :, None] * np.linalg.cholesky(shape)
