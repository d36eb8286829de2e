"""Ids of landmarks, by plain rules on made-up frames."""

from itertools import pairwise

import numpy as np

from depth_scenes import CAMERA
from slamduel.frontend.depth.features import Features
from slamduel.frontend.depth.level import Level
from slamduel.frontend.depth.pairs import Keyframe, Pair, without_ids
from slamduel.frontend.depth.planar import Planar
from slamduel.frontend.depth.points import Points
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.depth.tracks import Tracks

NO_MOTION = Planar(np.zeros(3), np.eye(3))


def frame(step: int, n: int = 6) -> Keyframe:
    rng = np.random.default_rng(step)
    points = Points(rng.uniform(-0.3, 0.3, (n, 2)), rng.uniform(1, 3, n), np.full(n, 0.01), np.full(n, 0.002))
    pixels = np.column_stack((10.0 * np.arange(float(n)), np.zeros(n)))
    features = Features(pixels, points, np.zeros((n, 32), np.uint8))
    level = Level(CAMERA.mounting, 1e-7 * np.eye(3), True)
    return Keyframe(step, float(step), features, level, np.zeros((1, 1), np.float32), without_ids(features))


def pair(first: Keyframe, second: Keyframe, rows: list[list[int]]) -> Pair:
    return Pair(first, second, NO_MOTION, np.array(rows))


def test_a_feature_keeps_its_id_from_frame_to_frame() -> None:
    tracks, (a, b, c) = Tracks(Settings()), (frame(k) for k in range(3))
    tracks.link(pair(a, b, [[0, 1], [2, 3]]))
    assert a.ids.tolist() == [0, -1, 1, -1, -1, -1]
    assert b.ids.tolist() == [-1, 0, -1, 1, -1, -1]
    tracks.link(pair(b, c, [[1, 5], [4, 0]]))
    assert c.ids.tolist() == [2, -1, -1, -1, -1, 0]


def test_an_id_is_in_a_frame_once_and_is_not_changed() -> None:
    tracks, (a, b, c) = Tracks(Settings()), (frame(k) for k in range(3))
    tracks.link(pair(a, c, [[0, 0]]))
    tracks.link(pair(a, b, [[0, 2], [1, 3]]))
    tracks.link(pair(b, c, [[2, 4], [3, 0]]))  # the landmark of 2 is there already, and 0 has another
    assert c.ids.tolist() == [0, -1, -1, -1, -1, -1]
    assert b.ids.tolist() == [-1, -1, 0, 1, -1, -1]


def test_a_feature_beside_a_landmark_is_none() -> None:
    """Those of rows 1 and 4 are 2 px from that of row 0, and one of row 5 is 4 px from it."""
    tracks, (a, b, c) = Tracks(Settings()), (frame(k) for k in range(3))
    for one in (a, b, c):
        one.features.pixels[[1, 4, 5]] = [[2.0, -1.0], [-2.0, 2.0], [4.0, 0.0]]
    tracks.link(pair(a, b, [[0, 0], [1, 1], [2, 2], [5, 5]]))
    assert a.ids.tolist() == [0, -1, 1, -1, -1, 2]
    assert b.ids.tolist() == [0, -1, 1, -1, -1, 2]
    tracks.link(pair(b, c, [[4, 4], [1, 1], [5, 5]]))
    assert b.ids.tolist() == [0, -1, 1, -1, -1, 2]
    assert c.ids.tolist() == [-1, -1, -1, -1, -1, 2]


def test_landmarks_seen_too_rarely_are_left_out_and_those_seen_most_come_first() -> None:
    settings = Settings(sightings=2)
    tracks, frames = Tracks(settings), [frame(k) for k in range(6)]
    for k in range(5):
        rows = [[0, 0], [1, 1], [2, 2]] if k < 4 else [[0, 0]]
        tracks.link(pair(frames[k], frames[k + 1], rows if k != 2 else rows[:2]))
    seen = tracks.chosen()
    # 0 is seen six times, 1 five; 2 three times before the gap, and as 3 twice after it: too rarely
    assert seen.step.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5]
    assert seen.ids.tolist() == [0, 1] * 5 + [0]
    assert (np.diff(seen.step) >= 0).all()


def test_a_landmark_has_its_sightings_where_steps_have_too_many_and_no_room_is_left_empty() -> None:
    """Features that come and go at random: what is in the log is what a step has room for, of the landmarks in it."""
    rng, settings, size = np.random.default_rng(3), Settings(sightings=4), 40
    tracks, frames = Tracks(settings), [frame(k, size) for k in range(40)]
    for k in range(39):
        rows = np.flatnonzero(rng.random(size) < 0.75)
        tracks.link(pair(frames[k], frames[k + 1], np.column_stack((rows, rows)).tolist()))
    seen = tracks.chosen()
    ids, times = np.unique(seen.ids, return_counts=True)
    assert len(ids) > 10
    assert times.min() >= settings.seen_often
    known = np.concatenate([one.ids[one.ids >= 0] for one in frames])
    often = np.bincount(known)
    for k, one in enumerate(frames):
        chosen, there = seen.ids[seen.step == k], one.ids[np.isin(one.ids, ids)]
        assert len(chosen) == min(len(there), settings.sightings)
        if len(chosen) < len(there):
            assert often[chosen].min() >= often[there[~np.isin(there, chosen)]].max()


def test_steps_between_which_all_landmarks_change_keep_some_in_common() -> None:
    """A quick turn: those seen often are on either side of it, and few of both. As many as needed come first."""
    settings, size = Settings(sightings=9), 40
    tracks, frames = Tracks(settings), [frame(k, size) for k in range(10)]
    for k in range(9):
        rows = np.arange(12) if k < 4 else np.arange(12, 24) if k > 4 else np.arange(24, 32)
        tracks.link(pair(frames[k], frames[k + 1], np.column_stack((rows, rows)).tolist()))
    seen = tracks.chosen()
    at = [set(seen.ids[seen.step == k].tolist()) for k in range(10)]
    assert all(len(ids) == 9 for ids in at)
    assert [len(a & b) for a, b in pairwise(at)] == [9, 9, 9, 6, 3, 6, 9, 9, 9]  # three sightings of nine
    turn = at[4] & at[5]
    assert all(np.count_nonzero(seen.ids == one) == 2 for one in turn)
    others = np.unique(seen.ids[~np.isin(seen.ids, list(turn))], return_counts=True)[1]
    assert others.min() >= settings.seen_often


def test_a_step_without_a_neighbour_is_linked_to_the_one_before_that() -> None:
    """Nothing matched from step 4 to 5, but from 2 to 5."""
    settings, size = Settings(sightings=9), 40
    tracks, frames = Tracks(settings), [frame(k, size) for k in range(10)]
    for k in range(9):
        rows = np.arange(12) if k < 4 else np.arange(12, 24)
        if k != 4:
            tracks.link(pair(frames[k], frames[k + 1], np.column_stack((rows, rows)).tolist()))
    rows = np.arange(30, 35)
    tracks.link(pair(frames[2], frames[5], np.column_stack((rows, rows)).tolist()))
    seen = tracks.chosen()
    at = [set(seen.ids[seen.step == k].tolist()) for k in range(10)]
    assert len(at[4] & at[5]) == 0
    assert len(at[2] & at[5]) == 3


def test_sightings_are_ranges_and_bearings_of_levelled_points_with_their_covariance() -> None:
    settings = Settings()
    tracks, frames = Tracks(settings), [frame(k) for k in range(4)]
    for k in range(3):
        tracks.link(pair(frames[k], frames[k + 1], [[1, 1]]))
    seen = tracks.chosen()
    rng, draws = np.random.default_rng(0), 40_000
    points = frames[2].features.points
    rays = points.rays[1] + settings.seen_apart * points.ray_sd[1] * rng.normal(0, 1, (draws, 2))
    z = points.z[1] + points.z_sd[1] * rng.normal(0, 1, draws)
    xyz = np.column_stack((rays * z[:, None], z)) @ CAMERA.mounting[:3, :3].T + CAMERA.mounting[:3, 3]
    exact = np.array([*points.rays[1], 1.0]) * points.z[1]
    x, y, up = CAMERA.mounting[:3, :3] @ exact + CAMERA.mounting[:3, 3]
    np.testing.assert_allclose(seen.z[2], [np.hypot(x, y), np.arctan2(y, x)], rtol=1e-12)
    turns = np.sqrt(1e-7) * rng.normal(0, 1, (draws, 2))
    at = xyz[:, :2] + up * np.column_stack((turns[:, 1], -turns[:, 0]))
    floors = [settings.floor, settings.turn_floor] * rng.normal(0, 1, (draws, 2))
    drawn = np.cov(np.column_stack((np.hypot(*at.T), np.arctan2(at[:, 1], at[:, 0]))) + floors, rowvar=False)
    sd = np.sqrt(np.diag(seen.cov[2]))
    # sqrt(2 / 40000) of sampling, six of them, and the range's curvature in the bearing
    assert (np.abs(drawn - seen.cov[2]) < 0.05 * np.outer(sd, sd)).all()


def test_without_pairs_there_are_no_sightings() -> None:
    seen = Tracks(Settings()).chosen()
    assert len(seen.ids) == 0
    assert seen.cov.shape == (0, 2, 2)
