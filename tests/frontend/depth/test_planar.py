"""Motions on the floor: derivatives, levels and the place that a body rocks about."""

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from depth_scenes import CAMERA
from differences import central
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.disturbances import rocked
from slamduel.frontend.depth.level import Level
from slamduel.frontend.depth.planar import adjoint, camera_motion, planar, skew
from slamduel.frontend.depth.registration import Registration
from slamduel.frontend.depth.settings import Settings

NO_FLOORS = Settings(floor=1e-5, turn_floor=1e-6)
UNKNOWN, EXACT = 1e6 * np.eye(3), 1e-14 * np.eye(3)
MOVED = np.array([0.16, -0.02, 0.11])


def on_floor(pose: Array) -> Array:
    """(4, 4) of a pose (3,) on the floor."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0, 0, pose[2]]).as_matrix()
    T[:2, 3] = pose[:2]
    return T


def registration_of(first: Array, second: Array, cov: Array) -> Registration:
    """An exact one between cameras at two places (4, 4)."""
    T = np.linalg.inv(first) @ second
    return Registration(T[:3, :3], T[:3, 3], cov, np.zeros(0, np.int64), 1.0)


def some_cov() -> Array:
    A = np.random.default_rng(4).normal(0, 1, (6, 9))
    return 1e-6 * A @ A.T


def moved_by(found: Registration, x: Array) -> Registration:
    hat = np.zeros((4, 4))
    hat[:3, :3], hat[:3, 3] = skew(x[3:]), x[:3]
    T = expm(hat)
    return found._replace(R=T[:3, :3] @ found.R, t=T[:3, :3] @ found.t + T[:3, 3])


def test_a_body_that_rocks_about_its_origin_moves_as_its_origin_does() -> None:
    bodies = on_floor(np.zeros(3)) @ rocked(0.03, -0.02), on_floor(MOVED) @ rocked(-0.02, 0.04)
    found = registration_of(bodies[0] @ CAMERA.mounting, bodies[1] @ CAMERA.mounting, some_cov())
    first, second = (Level(rocked(*by) @ CAMERA.mounting, UNKNOWN, True) for by in ((0.03, -0.02), (-0.02, 0.04)))
    np.testing.assert_allclose(planar(found, first, second, NO_FLOORS).delta, MOVED, atol=1e-12)


def test_covariance_without_levels_is_that_of_a_numerical_jacobian() -> None:
    level = Level(rocked(0.02, 0.01) @ CAMERA.mounting, UNKNOWN, True)
    found = registration_of(CAMERA.mounting, on_floor(MOVED) @ CAMERA.mounting, some_cov())
    J = central(lambda x: planar(moved_by(found, x), level, level, NO_FLOORS).delta, np.zeros(6))
    expected, stated = J @ found.cov @ J.T + np.diag([1e-10, 1e-10, 1e-12]), planar(found, level, level, NO_FLOORS).cov
    np.testing.assert_allclose(stated, expected, rtol=1e-4, atol=1e-5 * expected.max())


def test_exact_levels_take_away_the_errors_of_pitch_roll_and_height() -> None:
    """As conditioning the six errors, in the first robot's frame, on three that are zero."""
    level = Level(CAMERA.mounting, EXACT, True)
    exact = registration_of(CAMERA.mounting, on_floor(MOVED) @ CAMERA.mounting, some_cov())
    A = adjoint(CAMERA.mounting[:3, :3], CAMERA.mounting[:3, 3])
    cov = A @ exact.cov @ A.T
    # at the second robot's origin: a turn moves it
    shift = np.eye(6)
    x, y, _ = MOVED
    shift[:3, 3:] = -np.array([[0, 0, y], [0, 0, -x], [-y, x, 0.0]])
    cov = shift @ cov @ shift.T
    free, held = [0, 1, 5], [2, 3, 4]
    gain = cov[np.ix_(free, held)] @ np.linalg.inv(cov[np.ix_(held, held)])
    expected = cov[np.ix_(free, free)] - gain @ cov[np.ix_(held, free)]
    motion = planar(exact, level, level, NO_FLOORS)
    np.testing.assert_allclose(motion.cov, expected + np.diag([1e-10, 1e-10, 1e-12]), rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(motion.delta, MOVED, atol=1e-10)


def test_levels_take_back_a_large_turn_about_a_far_line_of_features() -> None:
    """Features in a strip leave the turn about it open: the camera moves along an arc, which is no straight line."""
    level = Level(CAMERA.mounting, np.diag([1e-3, 1e-3, 2e-3]) ** 2, True)
    exact = registration_of(CAMERA.mounting, on_floor(MOVED) @ CAMERA.mounting, np.eye(6))
    for angle in (-0.12, 0.04, 0.12):
        turn = np.array([angle, 0.0, 0.0])
        twist = np.concatenate((-np.cross(turn, [0.0, 0.0, 3.4]), turn))  # about a line to the right, 3.4 m ahead
        off = moved_by(exact, twist)._replace(cov=np.outer(twist, twist) + 1e-8 * np.eye(6))
        found = planar(off, level, level, NO_FLOORS)
        # turned and then shifted, 0.12 rad leave 3.4 m * 0.12^2 / 2 = 24 mm
        np.testing.assert_allclose(found.delta, MOVED, atol=0.002)


def test_errors_of_levelled_motions_are_as_large_as_stated() -> None:
    rng, trials = np.random.default_rng(9), 2000
    cov, levels = 20 * some_cov(), np.diag([4e-6, 4e-6, 1e-6])
    L, M = np.linalg.cholesky(cov), np.linalg.cholesky(levels)
    exact = registration_of(CAMERA.mounting, on_floor(MOVED) @ CAMERA.mounting, cov)
    squared = np.empty(trials)
    for k in range(trials):
        wrong = [Rotation.from_rotvec([*x[:2], 0]).as_matrix() for x in (M @ rng.normal(0, 1, (3, 2))).T]
        up = 1e-3 * rng.normal(0, 1, 2)
        first, second = (Level(_raised(R, h) @ CAMERA.mounting, levels, True) for R, h in zip(wrong, up, strict=True))
        motion = planar(moved_by(exact, L @ rng.normal(0, 1, 6)), first, second, NO_FLOORS)
        e = motion.delta - MOVED
        squared[k] = e @ np.linalg.solve(motion.cov, e) / 3
    # the mean errs by sqrt(2 / 3 / 2000) = 0.018
    assert abs(squared.mean() - 1) < 0.08


def _raised(R: Array, up: float) -> Array:
    T = np.eye(4)
    T[:3, :3], T[2, 3] = R, up
    return T


def test_the_cameras_motion_is_that_of_the_robot() -> None:
    first, second = (Level(rocked(*by) @ CAMERA.mounting, EXACT, True) for by in ((0.03, -0.02), (-0.02, 0.04)))
    R, t = camera_motion(MOVED, first, second)
    found = Registration(R, t, some_cov(), np.zeros(0, np.int64), 1.0)
    np.testing.assert_allclose(planar(found, first, second, NO_FLOORS).delta, MOVED, atol=1e-9)


def test_floors_are_added_once() -> None:
    level = Level(CAMERA.mounting, UNKNOWN, True)
    found = registration_of(CAMERA.mounting, on_floor(MOVED) @ CAMERA.mounting, some_cov())
    plain, floors = (planar(found, level, level, s) for s in (NO_FLOORS, Settings(floor=5e-4, turn_floor=2e-4)))
    np.testing.assert_allclose(floors.cov - plain.cov, np.diag([5e-4**2, 5e-4**2, 2e-4**2]), rtol=1e-2, atol=1e-12)


def test_a_motion_has_at_least_the_stated_floors_and_its_share() -> None:
    settings = Settings(floor=0.004, turn_floor=0.003, floor_share=0.2)
    level = Level(CAMERA.mounting, UNKNOWN, True)
    found = registration_of(CAMERA.mounting, on_floor(MOVED) @ CAMERA.mounting, some_cov())
    more = planar(found, level, level, settings).cov - planar(found, level, level, NO_FLOORS).cov
    way = np.hypot(*MOVED[:2])
    expected = [0.004**2 + (0.2 * way) ** 2, 0.004**2 + (0.2 * way) ** 2, 0.003**2 + (0.2 * MOVED[2]) ** 2]
    np.testing.assert_allclose(more, np.diag(expected), atol=1e-9)
