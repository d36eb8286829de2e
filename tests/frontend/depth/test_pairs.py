"""Pairs of rendered frames against their true motions: features, levels, checks, movers."""

from itertools import pairwise

import numpy as np
import pytest

from depth_drives import drive, keyframe
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.rendering.depth_shots import DepthShots
from slamduel.datasets.worlds.depth_room import Drive, record
from slamduel.frontend.depth.features import Finder
from slamduel.frontend.depth.pairs import Keyframe, Pair, Pairs
from slamduel.frontend.depth.planar import Planar, distance
from slamduel.frontend.depth.recording import DepthFrame, DepthRecording
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.depth.tracks import sightings

CHI2_9999 = 21.1  # of 3 degrees of freedom


def pair_of(first: Keyframe, second: Keyframe, pairs: Pairs, known: Planar | None = None) -> Pair | None:
    return pairs.register(first, second, 12, None if known is None else lambda: known).pair


def errors_of(found: list[Planar], poses: Array) -> Array:
    """(n - 1, 3) of motions between neighbours."""
    e = np.array([one.delta for one in found]) - between(poses[:-1], poses[1:])
    e[:, 2] = wrap(e[:, 2])
    return e


@pytest.mark.parametrize("kind", ["orb", pytest.param("sift", marks=pytest.mark.slow)])
def test_motions_between_neighbours_are_as_exact_as_stated(kind: str) -> None:
    settings = Settings(features=kind)
    recording, shown, truth = drive(1, Drive(), 16)
    frames = [keyframe(k, frame, recording, settings) for k, frame in enumerate(shown)]
    pairs = Pairs(recording.camera, settings)
    found = [pair_of(a, b, pairs) for a, b in pairwise(frames)]
    motions = [pair.motion for pair in found if pair is not None]
    assert len(motions) == 15
    e = errors_of(motions, truth.poses)
    # the ten seeds' rmse are 1 and 2.5 mm and 0.06 degrees; of 15 pairs an rmse errs by a fifth
    assert np.sqrt((e[:, :2] ** 2).mean()) < 0.004
    assert np.sqrt((e[:, 2] ** 2).mean()) < np.radians(0.12)
    squared = np.array([x @ np.linalg.solve(one.cov, x) for x, one in zip(e, motions, strict=True)])
    assert squared.max() < CHI2_9999 * 1.5
    assert 0.25 < squared.mean() / 3 < 1.8  # 1 and three standard errors of 15 draws, a little cautious


@pytest.mark.slow
def test_the_errors_of_neighbours_are_as_stated_over_ten_rooms() -> None:
    settings, off, squared = Settings(), list[Array](), list[float]()
    for seed in range(10):
        recording, truth = record(Drive(), np.random.default_rng(seed))
        shots, pairs = recording.frames, Pairs(recording.camera, settings)
        assert isinstance(shots, DepthShots)
        frames = [keyframe(k, shots.shot(k), recording, settings) for k in range(40, 47)]
        for a, b in pairwise(frames):
            found = pair_of(a, b, pairs)
            if found is not None:
                (e,) = errors_of([found.motion], truth.poses[a.step : a.step + 2])
                off.append(e)
                squared.append(float(e @ np.linalg.solve(found.motion.cov, e)))
    assert len(off) >= 55
    x, y, heading = np.sqrt((np.array(off) ** 2).mean(axis=0))
    assert max(x, y) < 0.004
    assert heading < np.radians(0.12)
    # 0.8 over long drives; the mean of 60 pairs, of which neighbours share a frame, errs by 0.12
    assert 0.45 < np.mean(squared) / 3 < 1.3


def test_a_pair_is_the_same_whatever_was_registered_before() -> None:
    settings = Settings()
    recording, shown, _ = drive(1, Drive(), 16)
    frames = [keyframe(k, frame, recording, settings) for k, frame in enumerate(shown[:4])]
    pairs = Pairs(recording.camera, settings)
    alone = pair_of(frames[2], frames[3], Pairs(recording.camera, settings))
    pair_of(frames[0], frames[1], pairs)
    again = pair_of(frames[2], frames[3], pairs)
    np.testing.assert_array_equal(alone.motion.delta, again.motion.delta)
    np.testing.assert_array_equal(alone.rows, again.rows)


def test_levels_are_those_of_the_rendered_body() -> None:
    settings = Settings()
    recording, shown, truth = drive(1, Drive(), 16)
    shots = record(Drive(), np.random.default_rng(1))[0].frames
    assert isinstance(shots, DepthShots)
    off = np.empty((16, 2))
    for k, frame in enumerate(shown):
        level = keyframe(k, frame, recording, settings).level
        assert level.found
        x, y, heading = truth.poses[k]
        c, s = np.cos(heading), np.sin(heading)
        on_floor = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])
        D = level.T @ np.linalg.inv(np.linalg.inv(on_floor) @ shots.poses[k])
        off[k] = D[2, 1], D[0, 2]
    roll, pitch = np.degrees(np.sqrt((off**2).mean(axis=0)))
    assert roll < 0.05
    assert pitch < 0.15


def test_sightings_are_where_the_points_are_from_the_true_pose() -> None:
    """Two frames' sightings of the same features, laid into the world by the true poses, agree as stated."""
    settings = Settings()
    recording, shown, truth = drive(1, Drive(), 16)
    one, other = (keyframe(k, shown[k], recording, settings) for k in (3, 6))
    pair = pair_of(one, other, Pairs(recording.camera, settings))
    places, covs = [], []
    for frame, rows, pose in zip((one, other), pair.rows.T, truth.poses[[3, 6]], strict=True):
        z, cov = sightings(frame, rows, settings)
        bearing = z[:, 1] + pose[2]
        places.append(pose[:2] + z[:, :1] * np.column_stack((np.cos(bearing), np.sin(bearing))))
        c, s = np.cos(bearing), np.sin(bearing)
        J = np.stack((c, -z[:, 0] * s, s, z[:, 0] * c), axis=-1).reshape(-1, 2, 2)
        covs.append(J @ cov @ J.swapaxes(1, 2))
    off = places[0] - places[1]
    squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covs[0] + covs[1]), off) / 2
    assert len(squared) > 40
    assert 0.2 < squared.mean() < 1.5  # inliers of a gate at 99 %, with a pixel's sd that is cautious
    assert np.median(np.abs(off)) < 0.02


def moving(seed: int, count: int) -> tuple[DepthRecording, list[DepthFrame], Array, list[int]]:
    """A drive before which a box crosses, its true poses, and the frames in which the box is near."""
    recording, shown, truth = drive(seed, Drive(mover=0.35), count)
    near = [k for k, frame in enumerate(shown) if _share_near(frame.depth) > 0.08]
    return recording, shown, truth.poses, near


def _share_near(depth: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> float:
    """The share of the upper half of an image that is nearer than a wall."""
    upper = depth[: len(depth) // 2]
    return float(((upper > 0) & (upper < 1.6)).mean())


@pytest.mark.slow
def test_no_motion_of_a_box_that_crosses_the_view_is_accepted() -> None:
    settings = Settings()
    recording, shown, poses, near = moving(1, 45)
    assert len(near) >= 8
    pairs, followed, right = Pairs(recording.camera, settings), 0, 0
    blind = Pairs(recording.camera, Settings(wheels_check=False, surfaces=False))
    for k in near:
        if k == 0:
            continue
        one, other = (keyframe(j, shown[j], recording, settings) for j in (k - 1, k))
        wheels = Planar(*recording.motion.odometry(one.t, other.t))
        true = Planar(between(poses[k - 1], poses[k]), np.zeros((3, 3)))
        found = pair_of(one, other, pairs, wheels)
        if found is not None:
            off = found.motion.delta - true.delta
            assert distance(found.motion, true) < CHI2_9999 * 2 or np.hypot(*off[:2]) < 0.01
            right += 1
        unchecked = pair_of(one, other, blind)
        followed += unchecked is not None and distance(unchecked.motion, true) > 100
    assert right > 0
    assert followed > 0


def test_frames_of_different_places_are_no_pair() -> None:
    settings = Settings()
    recording, shown, _ = drive(1, Drive(), 16)
    _, others, _ = drive(2, Drive(), 4)
    one, two = (keyframe(0, shown[0], recording, settings), keyframe(1, others[0], recording, settings))
    trial = Pairs(recording.camera, settings).register(one, two, 12, None)
    assert trial.pair is None
    assert trial.reason


def test_a_motion_that_contradicts_the_wheels_is_refused_and_counted() -> None:
    settings = Settings()
    recording, shown, truth = drive(1, Drive(), 16)
    one, two = (keyframe(k, shown[k], recording, settings) for k in (4, 6))
    wrong = Planar(between(truth.poses[4], truth.poses[6]) + np.array([0.2, 0.0, 0.0]), np.diag([1e-4, 1e-4, 1e-4]))
    refused = Pairs(recording.camera, settings).register(one, two, 12, lambda: wrong)
    assert refused.pair is None
    assert refused.reason == "it contradicts the wheels"
    assert len(refused.contradicted) > 0.5 * len(refused.matches)
    unchecked = Settings(wheels_check=False)
    taken = Pairs(recording.camera, unchecked).register(one, two, 12, lambda: wrong)
    assert taken.pair is not None
    assert not len(taken.contradicted)


def test_a_blank_image_has_no_features() -> None:
    recording, shown, _ = drive(1, Drive(), 16)
    for kind, length in (("orb", 32), ("sift", 128)):
        finder = Finder(recording.camera, Settings(features=kind))
        found = finder.find(np.full((480, 640), 90, np.uint8), shown[0].depth)
        assert len(found) == 0
        assert found.descriptors.shape == (0, length)
        nothing = finder.find(shown[0].grey, np.zeros((480, 640), np.float32))
        assert len(nothing) == 0
