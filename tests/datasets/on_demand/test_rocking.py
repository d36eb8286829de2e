"""A body that rocks smoothly: by as much as asked for, and as its frames and its inertial readings both have it."""

import numpy as np
import pytest

from slamduel.core.se2 import Array
from slamduel.datasets.on_demand.gyro import WorldGyro
from slamduel.datasets.on_demand.imu import SHAKES, imu_of
from slamduel.datasets.on_demand.rocking import RATES, Rocking
from slamduel.datasets.rendering.disturbances import Disturbances, raised, rocked, take
from slamduel.datasets.worlds.aruco_room import Options, recorded
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import drive
from slamduel.frontend.inertial.imu import GRAVITY
from slamduel.frontend.inertial.levels import OFFSET

SPEED = 0.4


def along(t: Array) -> tuple[Array, Array]:
    return drive(LOOP, SPEED, t)


def body(seed: int = 0, sway: float = 0.02) -> Rocking:
    return Rocking.drawn(sway, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(4))
def test_it_rocks_by_as_much_as_asked_for_and_as_fast_as_it_says(seed: int) -> None:
    one, t = body(seed), np.arange(0, 2000, 0.05)
    np.testing.assert_allclose(one.at(t).std(axis=0), 0.02, rtol=0.05)
    numeric = (one.at(t + 1e-4) - one.at(t - 1e-4)) / 2e-4
    np.testing.assert_allclose(one.rates(t), numeric, atol=1e-7)
    assert ((one.frequency > 2 * np.pi * RATES[0]) & (one.frequency < 2 * np.pi * RATES[1])).all()


def pose_of(one: Rocking, t: Array) -> Array:
    """(n, 4, 4) T_world_body."""
    return raised(along(t)[0]) @ np.array([rocked(*angles) for angles in one.at(t)])


@pytest.mark.parametrize("seed", range(3))
def test_readings_are_those_of_the_body_that_is_rendered(seed: int) -> None:
    """Rates by the difference of its attitudes, forces by the second difference of its place, and gravity."""
    one, h = body(seed, 0.1), 0.02
    imu = imu_of(WorldGyro(gyro=1e-3), along, 30.0, np.random.default_rng(seed), one)
    assert imu is not None
    assert imu.accel is not None
    t = imu.t[200:]
    before, now, after = (pose_of(one, t + way) for way in (-h, 0.0, h))
    turn = np.einsum("nji,njk->nik", now[:, :3, :3], after[:, :3, :3] - before[:, :3, :3]) / (2 * h)
    rates = np.column_stack((turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]))
    np.testing.assert_allclose(imu.gyro[200:], rates, atol=8e-3)
    place = (after - 2 * now + before)[:, :3, 3] / h**2 + np.array([0, 0, GRAVITY])
    force = np.einsum("nji,nj->ni", now[:, :3, :3], place)
    off = imu.accel[200:] - force
    assert np.abs(off.mean(axis=0)).max() < 4 * OFFSET
    # The second difference has the kinks of the table of the path as well.
    np.testing.assert_allclose(off.std(axis=0)[2], SHAKES, rtol=0.1)
    assert off.std(axis=0).max() < 5 * SHAKES


def test_frames_are_taken_from_the_rocking_body() -> None:
    options = Options(seconds=1.0, frame_rate=4.0, imu=True)
    recording, _, _, imu, *_ = recorded(options, np.random.default_rng(2))
    assert imu is not None
    assert recording.tilts is not None
    plain, _, _, none, *_ = recorded(Options(seconds=1.0, frame_rate=4.0), np.random.default_rng(2))
    assert none is None
    assert plain.tilts is None
    taken: list[Array] = []

    class Seen:
        camera = recording.detector.camera
        sensor = type("Sensor", (), {"exposure": 0.0, "readout": 0.0})

        def frame(self, poses: Array, *_: object) -> Array:
            taken.append(poses)
            return np.zeros((2, 2))

    t, one = np.array([0.0, 0.5, 1.25]), body()
    list(take([Seen()], lambda at: along(at)[0], t, Disturbances(0.5), np.random.default_rng(0), one))  # pyright: ignore
    np.testing.assert_allclose(taken, pose_of(one, t) @ Seen.camera.mounting, atol=1e-12)
