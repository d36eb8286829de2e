"""The depth camera's room: its pictures and depths belong together, and its noise is as stated."""

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
import pytest

from refusals import refused
from slamduel.bench.plan.load import load
from slamduel.core.factors import UNKNOWN
from slamduel.core.se2 import Array, between
from slamduel.datasets.rendering.depth_shots import DepthShots
from slamduel.datasets.rendering.disturbances import raised, rocked
from slamduel.datasets.rendering.posters import FINEST, poster
from slamduel.datasets.rendering.sensor import LINES
from slamduel.datasets.worlds import depth_room
from slamduel.datasets.worlds.depth_room import START_SD, WHEELS, Drive, integrated, known, record
from slamduel.datasets.worlds.mover import ASIDE
from slamduel.frontend.depth.recording import DepthFrame
from slamduel.frontend.wheels.track import Track
from tiers import first_quick


@lru_cache(2)
def shots_of(options: Drive, seed: int = 1) -> DepthShots:
    return depth_room.shots_of(record(options, np.random.default_rng(seed))[0])


SHORT = Drive(laps=0.3)


def in_world(shots: DepthShots, depth: Array, poses: Array) -> Array:
    """(h, w, 3) the points of the pixels of a frame, whose rows have the `poses` (h, 4, 4) T_world_camera."""
    rays = shots.renderer.camera.rays
    points = np.dstack((rays, np.ones(rays.shape[:2]))) * depth[:, :, None]
    return np.einsum("vij,vuj->vui", poses[:, :3, :3], points) + poses[:, None, :3, 3]


def rows_of(shots: DepthShots, k: int) -> Array:
    """(h, 4, 4) the camera's poses as the rows are read."""
    height = shots.renderer.camera.height
    tilted = rocked(*shots.tilts[k]) @ shots.renderer.camera.mounting
    band = (np.arange(height) // LINES + 0.5) * LINES / height - 0.5
    return raised(shots.path(shots.t[k] + shots.renderer.sensor.readout * band)) @ tilted


def off_surfaces(shots: DepthShots, points: Array) -> Array:
    """(h, w) m, how far points are from the nearest of floor, walls, ceiling and boxes."""
    room = shots.renderer.room
    half = np.array([room.length / 2, room.width / 2])
    off = np.minimum(np.abs(points[..., 2]), np.abs(room.height - points[..., 2]))
    off = np.minimum(off, np.abs(half - np.abs(points[..., :2])).min(axis=-1))
    for box in room.boxes:
        for face in box.faces:
            local = (points - face.pose[:3, 3]) @ face.pose[:3, :3]
            beyond = np.maximum(np.abs(local[..., :2]) - [face.width / 2, face.height / 2], 0)
            off = np.minimum(off, np.sqrt((beyond**2).sum(axis=-1) + local[..., 2] ** 2))
    return off


@pytest.mark.parametrize("readout", first_quick([0.06, 0.0]))
def test_exact_depths_lie_on_the_rooms_surfaces_from_the_true_poses(readout: float) -> None:
    shots = shots_of(replace(SHORT, readout=readout))
    for k in (5, 20):
        points = in_world(shots, shots.exact_depth(k).astype(float), rows_of(shots, k))
        assert off_surfaces(shots, points).max() < 1e-5
        assert (points[..., 2] < 1e-5).mean() > 0.3  # the floor
        assert (points[..., 2] > 1e-5).mean() > 0.1


def test_with_a_rolling_shutter_one_pose_does_not_fit_all_rows() -> None:
    shots = shots_of(replace(SHORT, readout=0.06, boxes=0))
    k = 20
    assert np.linalg.norm(shots.path(shots.t[k : k + 2])[1, :2] - shots.path(shots.t[k : k + 2])[0, :2]) > 0.05
    depth = shots.exact_depth(k).astype(float)
    held = np.broadcast_to(shots.poses[k], (480, 4, 4))
    assert off_surfaces(shots, in_world(shots, depth, held)).max() > 1e-3


@pytest.mark.parametrize("readout", [0.0, pytest.param(0.06, marks=pytest.mark.slow)])
def test_grey_and_depth_are_of_the_same_pixels(readout: float) -> None:
    """A frame warped into the next one by its depths and the true poses looks like it; shifted by 2 px it does less."""
    shots = shots_of(replace(SHORT, readout=readout))
    k = 22
    first, second = shots.shot(k), shots.shot(k + 1)
    points = in_world(shots, first.depth.astype(float), rows_of(shots, k))
    error, right, below = (_warped_error(shots, first, second, points, k + 1, by) for by in ((0, 0), (2, 0), (0, 2)))
    assert error < 6.0
    assert min(right, below) > 1.3 * error


def _warped_error(
    shots: DepthShots, first: DepthFrame, second: DepthFrame, points: Array, k: int, shift: tuple[int, int]
) -> float:
    """Grey levels, rms difference of the first frame's pixels and those of the second that show the same points."""
    camera, rows = shots.renderer.camera, rows_of(shots, k)
    at = np.full(first.grey.shape, 240)
    pixels, inside, front = np.zeros((480, 640, 2)), points, first.depth > 0
    for _ in range(3):  # the row that a point is seen in says from where it is seen
        pose = rows[np.clip(at, 0, 479)]
        inside = np.einsum("vuji,vuj->vui", pose[..., :3, :3], points - pose[..., :3, 3])
        front = inside[..., 2] > 0.1
        pixels = camera.project(np.where(front[..., None], inside, [0, 0, 1]).reshape(-1, 3)).reshape(480, 640, 2)
        at = np.rint(pixels[..., 1]).astype(int)
    u, v = ((pixels[..., axis] + shift[axis]).astype(np.float32) for axis in (0, 1))
    first_light, second_light = (frame.grey / shots.renderer.lens.transmission(0.4) for frame in (first, second))
    seen = cv2.remap(second_light, u, v, cv2.INTER_LINEAR).astype(float)
    there = np.asarray(cv2.remap(second.depth, u, v, cv2.INTER_NEAREST))
    good = (first.depth > 0) & front & (u > 3) & (u < 636) & (v > 3) & (v < 476)
    good &= np.abs(there - inside[..., 2]) < 0.1  # not hidden
    assert good.mean() > 0.3
    return float(np.sqrt(((seen - first_light)[good] ** 2).mean()))


def test_frames_are_the_same_whenever_they_are_read() -> None:
    shots = shots_of(Drive(laps=0.05, mover=0.6, frame_rate=2.0))
    once, twice = list(shots), list(shots)
    other = shots_of(Drive(laps=0.05, mover=0.6, frame_rate=2.0), seed=2).shot(0)
    assert len(once) == len(shots) == len(twice) > 2
    for one, same in zip(once, twice, strict=True):
        assert one.grey.dtype == np.uint8
        assert one.depth.dtype == np.float32
        assert one.grey.shape == one.depth.shape == (480, 640)
        np.testing.assert_array_equal(one.grey, same.grey)
        np.testing.assert_array_equal(one.depth, same.depth)
    np.testing.assert_array_equal([frame.seconds for frame in once], shots.t)
    assert (once[0].grey != other.grey).mean() > 0.5


def test_the_body_rocks_as_much_as_it_is_told_to() -> None:
    shots = shots_of(Drive(laps=6.0, rocking=0.03))
    assert shots.tilts.std(axis=0) == pytest.approx(0.03, rel=4 / np.sqrt(2 * len(shots)))
    up = shots.poses @ np.linalg.inv(shots.renderer.camera.mounting)  # T_world_robot
    lean = np.arccos(up[:, 2, 2])
    np.testing.assert_allclose(lean**2, (shots.tilts**2).sum(axis=1), rtol=0.01, atol=1e-9)
    assert not shots_of(replace(SHORT, rocking=0.0)).tilts.any()


def test_odometry_errs_as_stated() -> None:
    """The normalised squared errors of 200 motions of 1 s are on average as many as their dimensions."""
    t = np.arange(0.0, 20.0, 0.02)
    poses = np.stack((0.4 * np.sin(0.3 * t) / 0.3, 0.4 * (1 - np.cos(0.3 * t)) / 0.3, 0.3 * t), axis=-1)
    at = np.arange(0.0, 19.0, 1.0)
    total, count = 0.0, 0
    for seed in range(20):
        track = Track(t, integrated(poses, WHEELS, 1.0, np.random.default_rng(seed)), WHEELS)
        found = track.motions(at)
        error = found.delta - between(poses[np.searchsorted(t, at[:-1])], poses[np.searchsorted(t, at[1:])])
        total += float(np.einsum("ni,nij,nj->", error, np.linalg.inv(found.cov), error))
        count += len(error)
    # Across the way the stated floor of 0.5 mm is most of it, and the errors are less.
    assert 2.0 < total / count < 3.0 * (1 + 4 * np.sqrt(2 / (3 * count)))
    exact = Track(t, integrated(poses, WHEELS, 0.0, np.random.default_rng(0)), WHEELS).motions(at)
    np.testing.assert_allclose(exact.delta, between(poses[:-50:50][:18], poses[50::50][:18]), atol=1e-9)


@pytest.mark.slow
def test_the_mover_crosses_the_view_and_meets_nothing() -> None:
    shots = shots_of(Drive(laps=1.0, mover=0.6, boxes=2), seed=2)
    room = shots.renderer.room
    covered = list[float]()
    robot = shots.path(shots.t)
    for k, visitor in list(enumerate(shots.visitors))[::2]:
        if visitor is None:
            continue
        place, radius = visitor.box.place[:2], visitor.box.radius
        assert (np.abs(place) + radius < [room.length / 2, room.width / 2]).all()
        assert all(np.linalg.norm(place - box.place[:2]) > radius + box.radius for box in room.boxes)
        assert np.linalg.norm(place - robot[k, :2]) > radius + 0.3
        without = replace(shots, visitors=())
        covered.append(float((shots.exact_depth(k) != without.exact_depth(k)).mean()))
    assert len(covered) > 7
    assert max(covered) > 0.4
    sides = [between(robot[k], one.box.place)[1] for k, one in enumerate(shots.visitors) if one is not None]
    assert max(sides) > 0.6 * ASIDE
    assert min(sides) < -0.6 * ASIDE


def test_a_mover_is_drawn_where_it_is_near() -> None:
    shots = shots_of(Drive(laps=1.0, mover=0.6, boxes=2), seed=2)
    robot = shots.path(shots.t)
    visitors = list(enumerate(shots.visitors))
    aside = [np.inf if one is None else abs(between(robot[k], one.box.place)[1]) for k, one in visitors]
    k = int(np.argmin(aside))
    frame, without = shots.shot(k), replace(shots, visitors=()).shot(k)
    nearer = (frame.depth < without.depth - 0.1) & (frame.depth > 0)
    assert nearer.mean() > 0.3
    assert (np.abs(frame.grey.astype(int) - without.grey)[nearer] > 12).mean() > 0.5
    unchanged = (shots.exact_depth(k) == replace(shots, visitors=()).exact_depth(k)).astype(np.uint8)
    far = np.asarray(cv2.erode(unchanged, np.ones((9, 9)))) > 0
    assert np.abs(frame.grey.astype(int) - without.grey)[far].max() <= 1


def corners_in(frame: DepthFrame) -> int:
    found = cv2.ORB.create(600).detect(frame.grey)
    return sum(frame.depth[round(point.pt[1]), round(point.pt[0])] > 0 for point in found)


def test_posters_and_rugs_are_something_to_see() -> None:
    seen = [corners_in(shots_of(SHORT).shot(k)) for k in (4, 19, 34)]
    bare = [corners_in(shots_of(replace(SHORT, posters=0, rugs=0)).shot(k)) for k in (4, 19, 34)]
    assert min(seen) > 300
    assert np.median(seen) > 1.5 * np.median(bare)


def test_one_poster_may_hang_everywhere() -> None:
    """All are found again by their middle parts, and there is no other place like them."""
    surfaces = shots_of(replace(SHORT, alike=True)).renderer.surfaces
    walls = surfaces.image[surfaces.wall_row :]
    different = shots_of(SHORT).renderer.surfaces.image[surfaces.wall_row :]
    copies = {}
    for name, image in (("alike", walls), ("different", different)):
        bare = shots_of(replace(SHORT, posters=0)).renderer.surfaces.image[surfaces.wall_row :]
        _, _, boxes, _ = cv2.connectedComponentsWithStats((image != bare).astype(np.uint8))
        left, top, width, height, _ = boxes[1 + int(np.argmax(boxes[1:, 4]))]
        piece = image[top + height // 4 : top + 3 * height // 4, left + width // 4 : left + 3 * width // 4]
        like = cv2.matchTemplate(image, piece, cv2.TM_CCOEFF_NORMED)
        copies[name] = int((like > 0.999).sum())
    assert copies == {"alike": 14, "different": 1}


def test_a_poster_has_corners_at_every_scale() -> None:
    picture = poster(120, 100, np.random.default_rng(3)).astype(np.uint8)
    for scale in (1, 2, 4):
        small = cv2.resize(picture, None, fx=1 / scale, fy=1 / scale, interpolation=cv2.INTER_AREA)
        found = cv2.goodFeaturesToTrack(small, 500, 0.05, FINEST)
        assert len(found) > 60 / scale**2


def test_a_shutter_slower_than_the_frames_is_refused() -> None:
    slow = Drive(readout=0.1, frame_rate=20.0)
    refused("readout=0.1: expected at most the time between frames, 0.05 s", record, slow, np.random.default_rng(0))


def test_one_log_for_each_seed_with_its_truth() -> None:
    short = "depth-room[laps=0.15,boxes=1]"
    log, truth = load(short, seed=3)
    again, _ = load(short, seed=3)
    other, _ = load(short, seed=4)
    assert log.digest == again.digest != other.digest
    np.testing.assert_array_equal(truth.t, log.t)
    assert len(log.ids) > 50
    # The wheels alone are within a few of their standard deviations over a metre and a half.
    off = between(truth.poses[0], truth.poses[-1]) - between(log.dead_reckoned()[0], log.dead_reckoned()[-1])
    assert np.hypot(*off[:2]) < 0.2
    assert "slamduel's own world" in log.notes["source"]


def test_ids_may_be_hidden() -> None:
    log, truth = load("depth-room[laps=0.1,boxes=1,ids=hidden]", seed=3)
    assert truth.assigned is not None
    assert (log.ids == UNKNOWN).all()
    assert (truth.assigned >= 0).all()


def test_the_start_is_known_as_well_as_the_prior_says() -> None:
    rng, pose = np.random.default_rng(4), np.array([1.0, -2.0, 0.5])
    priors = [known(pose, rng) for _ in range(500)]
    off = np.array([prior.pose for prior in priors]) - pose
    np.testing.assert_allclose(priors[0].cov, START_SD**2 * np.eye(3), rtol=1e-12)
    assert abs((off**2).mean() / START_SD**2 - 1) < 4 * np.sqrt(2 / 1500)
    recording, truth = record(SHORT, np.random.default_rng(1))
    assert 0 < np.abs(recording.prior.pose - truth.poses[0]).max() < 5 * START_SD
