"""A robot that speeds up, slows down and turns among landmarks, whose sensor and wheels have errors that stay."""

import numpy as np

from slamduel.bench.plan.reference import reference
from slamduel.bench.systematic.fit import SystematicFit, fitted, of_estimate, of_truth
from slamduel.core.factors import Dataset, Log, Map, Prior, Truth
from slamduel.core.se2 import Array, act, between, compose, inverse, summed, wrap
from slamduel.datasets.noise.systematic import Systematic, measured_motions, measured_sightings

DT = 0.1


def fit_of(dataset: Dataset, *, by_truth: bool, places: Map | None = None) -> SystematicFit:
    """The errors that are found by the true path, or around the batch optimum without it, perhaps with known places."""
    log, truth = dataset
    if by_truth:
        one = of_truth(log, truth)
    else:
        best = reference(log)
        assert best is not None
        assert best.map is not None
        one = of_estimate(log, best.poses, best.map, places)
    assert one is not None
    fit = fitted([one])
    assert fit is not None
    return fit


SIGMA_Z, SIGMA_U = np.array([0.03, 0.01]), np.array([0.003, 0.001, 0.002])


def way(seconds: float, seed: int, late: float = 0.0) -> tuple[Array, Array]:
    """Times (n,) and poses (n, 3), ten times as dense as a log's; of a robot that is `late` s."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0, seconds + 1e-9, DT / 10)
    phase = rng.uniform(0, 2 * np.pi, 4)
    at = fine - late
    v = 0.4 + 0.25 * np.sin(0.9 * at + phase[0]) + 0.1 * np.sin(0.23 * at + phase[1])
    turn = 0.45 * np.sin(0.6 * at + phase[2]) + 0.25 * np.sin(0.17 * at + phase[3])
    motions = np.column_stack((v, 0 * v, turn)) * DT / 10
    return fine, summed(np.zeros(3), motions[1:])


def drive(
    errors: Systematic,
    seed: int = 0,
    seconds: float = 120.0,
    noise: float = 1.0,
    known: float = 9.0,
    uneven: float = 0.0,
) -> Dataset:
    """The log of `seconds` with these errors, `noise` times the stated one, and its truth.

    Landmarks are seen up to `known` m, at every second step, by a sensor whose pictures are `errors.delay` old. Turns
    are off by another share, of standard deviation `uneven`, every 4 s.
    """
    rng = np.random.default_rng(seed + 1000)
    fine, every = way(seconds, seed)
    path = every[::10]
    t = fine[::10]
    landmarks = rng.uniform(-6, 6, (14, 2)) + path[:, :2].mean(axis=0)
    told = way(seconds, seed, errors.lag)[1][::10]
    moved, _ = measured_motions(between(told[:-1], told[1:]), errors)
    if uneven:
        share = np.random.default_rng(seed + 2000).normal(0, uneven, int(seconds / 4) + 1)
        moved[:, 2] *= 1 + share[(t[1:] / 4).astype(int)]
    delta = np.vstack((np.full(3, np.nan), moved + noise * rng.standard_normal(moved.shape) * SIGMA_U))
    turned = every.copy()
    turned[:, 2] = np.unwrap(turned[:, 2])
    then = np.stack([np.interp(t - errors.delay, fine, column) for column in turned.T], axis=-1)
    sensor = compose(then, np.array([errors.x, errors.y, errors.yaw]))
    step, ids, z = list[int](), list[int](), list[Array]()
    for k in range(2, len(t), 2):
        x, y = act(inverse(sensor[k]), landmarks).T
        r = np.hypot(x, y)
        for i in np.flatnonzero((r > 0.3) & (r < known)).tolist():
            step.append(k)
            ids.append(i)
            z.append(np.array([r[i], np.arctan2(y[i], x[i])]))
    seen = measured_sightings(np.array(z), errors)[0] + noise * rng.standard_normal((len(z), 2)) * SIGMA_Z
    seen[:, 1] = wrap(seen[:, 1])
    log = Log.from_arrays(
        f"planted-{seed}",
        Prior(path[0], 1e-6 * np.eye(3)),
        t,
        delta,
        np.broadcast_to(np.diag(SIGMA_U**2), (len(t), 3, 3)),
        np.array(step),
        np.array(ids),
        seen,
        np.broadcast_to(np.diag(SIGMA_Z**2), (len(z), 2, 2)),
    )
    return Dataset(log, Truth(t, path, Map(np.arange(len(landmarks)), landmarks, None)))
