"""The drift of poses against one another, and the place of a landmark that is sighted from them."""

import numpy as np
import pytest

from slamduel.backends.starting.drift import Drift, relative, wandered
from slamduel.backends.starting.late_places import LatePlaces, Seen
from slamduel.backends.starting.placing import CLEAR, placed
from slamduel.core.factors import Odometry
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import Array, between, compose, wrap

AT = np.array([2, 5, 5, 7, 10])
TURN_SD = 0.03
"""rad; of each motion's turn along the arc."""


def path_of(delta: Array) -> Array:
    path = [np.zeros(3)]
    for one in delta[1:]:
        path.append(compose(path[-1], one))
    return np.array(path)


def seen_from_the_last(path: Array, at: Array) -> Array:
    """The poses at rows `at` (k,) in the frame of the last of them, (3k,)."""
    return np.concatenate([between(path[at[-1]], path[i]) for i in at])


def drive(seed: int) -> tuple[Array, Array, Array]:
    """Motions (n, 3), their covariances (n, 3, 3), and the path (n, 3)."""
    rng = np.random.default_rng(seed)
    delta, roots = rng.normal(0, 0.3, (12, 3)), rng.normal(0, 1e-3, (12, 3, 3))
    return delta, roots @ roots.transpose(0, 2, 1), path_of(delta)


def propagated(delta: Array, cov: Array) -> Array:
    """The covariance of the poses at AT as seen from the last, by numerical derivatives, in the world's axes."""
    path, step = path_of(delta), 1e-6
    J = np.zeros((3 * len(AT), delta.size))
    for i in range(delta.size):
        more, less = delta.copy(), delta.copy()
        more.flat[i] += step
        less.flat[i] -= step
        J[:, i] = (seen_from_the_last(path_of(more), AT) - seen_from_the_last(path_of(less), AT)) / (2 * step)
    c, s = np.cos(path[AT[-1], 2]), np.sin(path[AT[-1], 2])
    turn = np.kron(np.eye(len(AT)), [[c, -s, 0], [s, c, 0], [0, 0, 1]])
    blocks = np.zeros((delta.size, delta.size))
    for i in range(1, len(delta)):
        blocks[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = cov[i]
    return turn @ J @ blocks @ J.T @ turn.T


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_propagation_of_the_motions_errors(seed: int) -> None:
    delta, cov, path = drive(seed)
    expected = propagated(delta, cov)
    assert np.abs(wandered(path, cov, AT) - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("seed", range(4))
def test_dead_reckoning_from_a_step_on_gives_the_same(seed: int) -> None:
    """Whatever the first step is called, and after more motions than there is room for at first."""
    delta, cov, path = drive(seed)
    drift = Drift()
    drift.begin(1000)
    for _ in range(90):
        drift.move(None)
    for i in range(1, len(delta)):
        drift.move(Odometry(delta[i], cov[i]))
    expected = wandered(path, cov, AT)
    assert np.abs(drift.between(AT + 1090, float(path[AT[-1], 2])) - expected).max() < 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_a_belief_in_the_world_has_the_same_drift(seed: int) -> None:
    """However badly the start is known: an error of it moves and turns all poses alike."""
    delta, cov, path = drive(seed)
    n, start = len(delta), np.diag([3.0, 2.0, 0.5])
    known = np.zeros((3 * n, 3 * n))
    known[:3, :3] = start
    for j in range(1, n):
        d = path[j, :2] - path[j - 1, :2]
        F = np.array([[1, 0, -d[1]], [0, 1, d[0]], [0, 0, 1]])
        c, s = np.cos(path[j - 1, 2]), np.sin(path[j - 1, 2])
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        here, before = slice(3 * j, 3 * j + 3), slice(3 * j - 3, 3 * j)
        known[here, : 3 * j] = F @ known[before, : 3 * j]
        known[: 3 * j, here] = known[here, : 3 * j].T
        known[here, here] = F @ known[before, before] @ F.T + R @ cov[j] @ R.T
    entries = (3 * AT[:, None] + np.arange(3)).ravel()
    found = relative(path[AT, :2], known[np.ix_(entries, entries)])
    assert np.abs(found - wandered(path, cov, AT)).max() < 1e-12


def arc(n: int) -> tuple[Array, Array]:
    """Motions (n, 3) along an arc, and their covariances, good along and bad at turning."""
    delta = np.tile([0.25, 0.0, 0.025], (n, 1))
    return delta, np.tile(np.diag([1e-4, 1e-4, TURN_SD**2]), (n, 1, 1))


def measured(pose: Array, xy: Array, kind: int) -> float:
    dx, dy = xy - pose[:2]
    return float(np.hypot(dx, dy) if kind == RANGE else wrap(np.arctan2(dy, dx) - pose[2]))


def errors(kind: int, sd: float, *, with_drift: bool) -> Array:
    """(k,) the squared Mahalanobis distances of a place's errors from the last pose, over two, of drawn drives.

    Of those where there is no other place.
    """
    rng, n = np.random.default_rng(4), 40
    delta, cov = arc(n)
    guess, at, out = path_of(delta), np.arange(n), []
    drift = wandered(guess, cov, at) if with_drift else None
    for _ in range(150):
        truth = path_of(delta + rng.standard_normal((n, 3)) * np.sqrt(cov[0].diagonal()))
        xy = np.array([3.0, 3.5])
        z = np.array([measured(pose, xy, kind) for pose in truth]) + sd * rng.standard_normal(n)
        place = placed(guess, np.full(n, kind), z, np.full(n, sd**2), drift)
        assert place is not None
        if place.clear <= CLEAR:
            continue
        off = place.xy - compose(guess[-1], between(truth[-1], np.append(xy, 0.0)))[:2]
        out.append(off @ np.linalg.solve(place.cov, off) / 2)
    return np.array(out)


@pytest.mark.parametrize(("kind", "sd"), [(BEARING, 0.02), (RANGE, 0.05)])
def test_a_place_is_as_uncertain_as_its_errors_with_the_drift(kind: int, sd: float) -> None:
    """A mean of 1 has a standard deviation of 0.08; turns this bad bend rings: 1.5. Without drift it is above 3."""
    found = errors(kind, sd, with_drift=True)
    assert len(found) > 100
    assert 0.7 < found.mean() < 1.8
    assert errors(kind, sd, with_drift=False).mean() > 3


def test_a_place_that_is_bad_with_drift_waits_longer() -> None:
    """By exact bearings it starts at once; as turns are known ever worse, later and later."""
    xy, started = np.array([3.0, 3.5]), []
    for turn_sd in (1e-4, 0.01, 0.02):
        delta, cov = arc(60)
        cov[:, 2, 2] = turn_sd**2
        path = path_of(delta)
        late = LatePlaces()
        for k, pose in enumerate(path):
            if late.waits:
                late.move(Odometry(delta[k], cov[k]))
            late.hold(7, Seen(k, BEARING, measured(pose, xy, BEARING), 0.01**2))
            place = late.found(7, path.__getitem__)
            if place is not None:
                started.append(k)
                assert np.hypot(*(place - xy)) < 1e-3
                break
    assert len(started) == 3
    assert started[0] < started[1] < started[2]


def test_the_lap_before_places_nothing() -> None:
    """What was seen before turns that are known badly leaves the place to what is seen now, as it would be alone."""
    delta, cov = arc(250 + 30)
    path = path_of(delta)
    xy, rng = np.array([3.0, 3.5]), np.random.default_rng(3)
    at = np.concatenate((np.arange(20), 250 + np.arange(20)))
    shifted = np.where(at < 20, 1.0, 0.0)  # m, rad: the robot was elsewhere by then
    z = np.array([measured(path[i], xy, RANGE) for i in at]) + 0.05 * rng.standard_normal(40) + shifted
    kind, var = np.full(40, RANGE), np.full(40, 0.05**2)
    both = placed(path[at], kind, z, var, wandered(path, cov, at))
    alone = placed(path[at[20:]], kind[20:], z[20:], var[20:], wandered(path, cov, at[20:]))
    assert both is not None
    assert alone is not None
    assert np.abs(both.xy - alone.xy).max() < 1e-9
    assert both.clear == pytest.approx(alone.clear)
