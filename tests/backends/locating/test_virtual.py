"""Sightings of several steps as places in one frame."""

import numpy as np
import pytest

from driven import NO_LOOPS
from slamduel.backends.locating.virtual import backward, virtual
from slamduel.core.factors import Odometry, RangeBearing, Step
from slamduel.core.se2 import Array, act, compose


def covariances(rng: np.random.Generator, n: int, size: int, sd: float) -> Array:
    roots = sd * (np.eye(size) + 0.3 * rng.standard_normal((n, size, size)))
    return roots @ roots.swapaxes(1, 2)


def drawn(seed: int, counts: tuple[int, ...]) -> list[Step]:
    """Steps with these numbers of sightings."""
    rng = np.random.default_rng(seed)
    steps = list[Step]()
    for k, n in enumerate(counts):
        z = np.column_stack((rng.uniform(0.5, 8, n), rng.uniform(-np.pi, np.pi, n)))
        seen = RangeBearing(np.arange(n), z, covariances(rng, n, 2, 0.05))
        motion = Odometry(rng.normal((0.4, 0, 0), 0.5), covariances(rng, 1, 3, 0.03)[0])
        steps.append(Step(float(k), motion if k else None, seen, NO_LOOPS))
    return steps


def placed(steps: list[Step], errors: Array) -> Array:
    """The places (2k,), motions and sightings having `errors`, of all in order."""
    pose, at, places = np.zeros(3), 0, list[Array]()
    for step in steps:
        if step.odometry is not None:
            pose = compose(pose, step.odometry.delta + errors[at : at + 3])
            at += 3
        for z in step.sightings.z:
            r, bearing = z + errors[at : at + 2]
            places.append(act(pose, np.array((r * np.cos(bearing), r * np.sin(bearing)))))
            at += 2
    return np.concatenate(places)


@pytest.mark.parametrize("counts", [(3,), (2, 0, 3), (0, 1, 1, 0, 4), (1, 1, 1, 1, 1, 1, 1, 1)])
def test_places_and_their_joint_covariance_are_those_of_numerical_jacobians(counts: tuple[int, ...]) -> None:
    steps = drawn(7, counts)
    sizes = [cov for step in steps for cov in (*([step.odometry.cov] if step.odometry else []), *step.sightings.cov)]
    n = sum(len(cov) for cov in sizes)
    noise, at = np.zeros((n, n)), 0
    for cov in sizes:
        noise[at : at + len(cov), at : at + len(cov)] = cov
        at += len(cov)
    h = 1e-6
    J = np.column_stack([(placed(steps, h * e) - placed(steps, -h * e)) / (2 * h) for e in np.eye(n)])
    found = virtual(steps)
    assert found.xy.ravel() == pytest.approx(placed(steps, np.zeros(n)), abs=1e-12)
    assert found.cov == pytest.approx(J @ noise @ J.T, abs=1e-8)
    assert found.step.tolist() == np.repeat(np.arange(len(counts)), counts).tolist()


def test_the_odometry_of_the_first_step_is_not_used() -> None:
    steps = drawn(3, (2, 2))
    moved = [steps[0]._replace(odometry=steps[1].odometry), steps[1]]
    assert np.array_equal(virtual(steps).xy, virtual(moved).xy)
    assert np.array_equal(virtual(steps).cov, virtual(moved).cov)


@pytest.mark.parametrize("counts", [(3,), (2, 0, 3), (1, 1, 1, 1)])
def test_driven_back_the_places_are_the_same_from_the_last_pose(counts: tuple[int, ...]) -> None:
    steps = drawn(5, counts)
    ahead, back = virtual(steps), virtual(backward(steps))
    end = np.zeros(3)
    for step in steps[1:]:
        end = compose(end, step.odometry.delta)
    order = np.argsort(-back.step, kind="stable")
    assert back.ids[order].tolist() == ahead.ids.tolist()
    assert act(end, back.xy[order]) == pytest.approx(ahead.xy, abs=1e-12)
    # The distance of two places is as unsure wherever it is seen from.
    for i, j in ((0, -1), (0, 1)):
        k, m = order[i], order[j]
        length = [np.subtract(*place) for place in ((ahead.xy[i], ahead.xy[j]), (back.xy[k], back.xy[m]))]
        spread = [
            along @ _gap(one.cov, a, b) @ along / (along @ along)
            for one, (a, b), along in zip((ahead, back), ((i, j), (k, m)), length, strict=True)
        ]
        assert spread[0] == pytest.approx(spread[1], rel=1e-9)


def _gap(cov: Array, i: int, j: int) -> Array:
    """The covariance (2, 2) of place i less place j."""
    n = len(cov) // 2
    i, j = 2 * (i % n), 2 * (j % n)
    a, b = slice(i, i + 2), slice(j, j + 2)
    return cov[a, a] + cov[b, b] - cov[a, b] - cov[b, a]


def test_without_sightings_there_are_no_places() -> None:
    found = virtual(drawn(1, (0, 0)))
    assert found.xy.shape == (0, 2)
    assert found.cov.shape == (0, 0)
