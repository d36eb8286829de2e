"""The filter with slow errors in its state, against whole covariances and against the invariant EKF."""

from typing import Any

import numpy as np
import pytest

from dense_fit import Normal, sighted
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Backend, Diverged
from slamduel.core.factors import Log, Map, RangeBearing, Step
from slamduel.core.se2 import Array, wrap

SLOW: dict[str, Any] = {"range_share": 0.9, "range_time": 0.7, "bearing_share": 0.6, "bearing_time": 2.0}


def driven(name: str, log: Log, **options: Any) -> tuple[Array, Array, list[float], Backend]:
    """Path, covariances, NIS of every step, and the backend at the end."""
    builder = registry.find(name)
    backend = builder.make(log.prior, builder.options(**options), np.random.default_rng(0))
    path, cov, nis = np.zeros((len(log), 3)), np.zeros((len(log), 3, 3)), list[float]()
    for k, step in enumerate(log):
        backend.step(step)
        belief = backend.belief()
        path[k], cov[k] = belief.pose, belief.cov
        nis.append(belief.nis or 0.0)
    return path, cov, nis, backend


@pytest.mark.parametrize("given", ["none", "held", "uncertain"])
def test_with_nothing_correlated_it_is_the_invariant_filter(given: str) -> None:
    log = random_log(np.random.default_rng(2), 300, 8, radius=4.0).log
    if given != "none":
        found = driven("invariant-ekf", log)[3].map()
        n = 2 * len(found.ids[::2])
        half = Map(found.ids[::2], found.xy[::2], None if given == "held" else 0.01 * np.eye(n))
        log = Log.from_steps("given", log.prior._replace(map=half), list(log))
    ours, theirs = driven("bias-ekf", log), driven("invariant-ekf", log)
    for one, other in zip(ours[:3], theirs[:3], strict=True):
        assert one == pytest.approx(other, abs=1e-9)
    one, other = ours[3].map(), theirs[3].map()
    assert one.ids.tolist() == other.ids.tolist()
    assert one.xy == pytest.approx(other.xy, abs=1e-9)
    assert one.cov == pytest.approx(other.cov, abs=1e-9)


@pytest.mark.parametrize("small", [1e-5, 1e-6])
def test_it_is_least_squares_with_the_whole_covariance_of_correlated_errors(small: float) -> None:
    """On a log with small noise the models are linear, but for terms smaller than noise by a factor of the noise.

    Standard deviations are some `small` times 5 cm and 0.02 rad; a state off by a few of them, seen from 0.5 m or
    more, changes each Jacobian by a share of `small` at most.
    """
    log = random_log(np.random.default_rng(5), 60, 4, noise=small, radius=9.0, blind=0.3).log
    path, cov, _, backend = driven("bias-ekf", log, **SLOW)
    mean, whole = least_squares(log, path, backend.map())
    last, found = path[-1], backend.map()
    sd = np.sqrt(np.diag(whole))
    off = np.array([*(mean[:2] - last[:2]), wrap(mean[2] - last[2]), *(mean[3:] - found.xy.ravel())])
    assert np.abs(off / sd).max() < small
    assert cov[-1] / np.outer(sd[:3], sd[:3]) == pytest.approx(whole[:3, :3] / np.outer(sd[:3], sd[:3]), abs=small)
    assert found.cov / np.outer(sd[3:], sd[3:]) == pytest.approx(whole[3:, 3:] / np.outer(sd[3:], sd[3:]), abs=small)


def least_squares(log: Log, path: Array, found: Map) -> tuple[Array, Array]:
    """The last pose with the map, and their covariance, by one dense step from the filter's estimates.

    Unknowns are all poses and landmarks; the covariance of all sightings' errors is written out, element by element.
    """
    n, m = len(path), len(found.ids)
    size, count = 3 * n + 2 * m, 2 * len(log.ids)
    normal = Normal(size)
    first = path[0] - log.prior.pose
    first[2] = wrap(first[2])
    normal.add([(0, np.eye(3))], first, log.prior.cov)
    for k in range(1, n):
        normal.add_motion(path, k - 1, k, log.delta[k], log.delta_cov[k])
    rows, errors, R = np.zeros((count, size)), np.zeros(count), np.zeros((count, count))
    shares, times = (SLOW["range_share"], SLOW["bearing_share"]), (SLOW["range_time"], SLOW["bearing_time"])
    column = {landmark: 3 * n + 2 * i for i, landmark in enumerate(found.ids.tolist())}
    for i, landmark in enumerate(log.ids.tolist()):
        k, at, two = int(log.sighting_step[i]), column[landmark], slice(2 * i, 2 * i + 2)
        errors[two], by_pose, by_xy = sighted(path[k], found.xy[(at - 3 * n) // 2], log.z[i])
        rows[two, 3 * k : 3 * k + 3], rows[two, at : at + 2] = by_pose, by_xy
        white = np.sqrt(1 - np.array(shares))
        R[two, two] = log.z_cov[i] * np.outer(white, white)
        for j in np.flatnonzero(log.ids == landmark).tolist():
            lag = abs(log.t[k] - log.t[log.sighting_step[j]])
            for h in range(2):
                sd = np.sqrt(log.z_cov[i, h, h] * log.z_cov[j, h, h])
                R[2 * i + h, 2 * j + h] += shares[h] * sd * np.exp(-lag / times[h])
    weighted = np.linalg.solve(R, rows)
    information = normal.matrix + rows.T @ weighted
    gradient = weighted.T @ errors - normal.right
    unit = 1 / np.sqrt(np.diag(information))
    whole = np.linalg.inv(information * np.outer(unit, unit)) * np.outer(unit, unit)
    last = np.r_[3 * n - 3 : 3 * n, 3 * n : size]
    state = np.concatenate((path[-1], found.xy.ravel()))
    return state - (whole @ gradient)[last], whole[np.ix_(last, last)]


def test_a_gate_keeps_a_wrong_sighting_out() -> None:
    log = random_log(np.random.default_rng(3), 100, 6, radius=5.0).log
    z = log.z.copy()
    wrong = np.flatnonzero(log.ids == log.ids[-1])[-1]
    z[wrong] += [2.0, 1.0]
    steps = list(log)
    k = int(log.sighting_step[wrong])
    first = log.sighting_first[k]
    seen = steps[k].sightings
    steps[k] = steps[k]._replace(sightings=RangeBearing(seen.ids, z[first : first + len(seen.ids)], seen.cov))
    spoilt = Log.from_steps("spoilt", log.prior, steps)
    right, gated, open_ = (
        driven("bias-ekf", one, **SLOW, gate=gate)[0][k] for one, gate in ((log, 0.0), (spoilt, 0.999), (spoilt, 0.0))
    )
    assert np.hypot(*(gated - right)[:2]) < 0.2 * np.hypot(*(open_ - right)[:2])


def test_a_landmark_at_the_robots_place_ends_the_run_with_a_sentence() -> None:
    log = random_log(np.random.default_rng(3), 2, 2).log
    builder = registry.find("bias-ekf")
    prior = log.prior._replace(map=Map(np.array([7]), log.prior.pose[None, :2].copy(), None))
    backend = builder.make(prior, builder.options(), np.random.default_rng(0))
    seen = RangeBearing(np.array([7]), np.array([[1.0, 0.0]]), 0.01 * np.eye(2)[None])
    with pytest.raises(Diverged, match="landmark 7 lies at the robot's own position"):
        backend.step(Step(0.0, None, seen, next(iter(log)).loops))
