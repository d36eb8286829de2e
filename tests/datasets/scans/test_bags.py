"""Laser scans in bags: the same factors as from a CARMEN log, however they are written, and what cannot be used."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
import floor_drives as floor
from floor_drives import BEGIN, NS
from fuzzing import survivors
from refusals import refusal, refused, refused_at
from slamduel.core.se2 import Array, between
from slamduel.datasets.scans.odometry import interpolated
from slamduel.datasets.scans.open import OpenedScans, ScanTopics, build, open_scans
from slamduel.frontend.camera.quaternions import matrix
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.pauses import PAUSE
from slamduel.frontend.wheels.track import Poses
from tiers import first_quick

Streams = Sequence[bags.Said]


@cache
def drive() -> LaserRecording:
    return floor.floor_drive()


@cache
def short() -> LaserRecording:
    """Its first 30 scans, for what needs no log."""
    whole = drive()
    return replace(whole, t=whole.t[:30], ranges=whole.ranges[:30], odometry=whole.odometry[:30])


def opened(path: Path, robot: Path | None = None, topics: ScanTopics | None = None) -> OpenedScans:
    found = open_scans(path, robot, topics)
    assert found is not None
    return found


def described(folder: Path, laser: str, rest: str = "") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(f"[laser]\n{laser}\n{rest}\n")
    return folder / "robot.toml"


def whole(folder: Path, kind: str = "ros2", drive: LaserRecording | None = None, **scans: Any) -> Path:
    """A bag of a drive's scans, odometry and the scanner's place."""
    drive = drive or short()
    return floor.bag(folder / "bag", kind, floor.scans(drive, **scans), floor.odometry(drive), floor.mounting())


@pytest.mark.parametrize("kind", first_quick(bags.KINDS, 2))
def test_the_same_scans_give_the_same_factors_in_every_kind_of_bag(kind: str, tmp_path: Path) -> None:
    expected = build(opened(floor.carmen(tmp_path / "floor.clf", drive()))).log
    found = opened(whole(tmp_path, kind, drive()))
    assert found.remarks == []
    log = build(found).log
    assert len(log) > 25
    for name in ("t", "delta", "delta_cov", "loop_to", "loop_delta", "loop_cov"):
        one, other = getattr(log, name), getattr(expected, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.prior.pose, expected.prior.pose, atol=1e-12)
    assert log.notes["topics"] == {"scan": "/scan", "odometry": "/odom"}
    assert "middle of its sweep" in log.notes["time"]
    assert log.notes[PAUSE] == pytest.approx(float(np.diff(drive().t).max()), abs=1e-6)  # not the time between steps


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
@pytest.mark.parametrize("parent", ["odom", "/odom", "robot1/odom"])
def test_tf_has_the_odometry_where_no_topic_has_it(kind: str, parent: str, tmp_path: Path) -> None:
    elsewhere = [bags.transforms(one, bags.Transform("map", "odom2", (1.0, 2.0, 0.0))) for one in floor.stamps(short())]
    said = floor.scans(short()), floor.by_tf(short(), parent), floor.mounting(), elsewhere
    found = opened(floor.bag(tmp_path / "bag", kind, *said))
    assert found.remarks == []
    one, other = found.recording.odometry, short().odometry
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_where_the_scanner_sits_is_told_by_tf(tmp_path: Path) -> None:
    """Through frames in between, from a base that is no root, and upside down: the same points."""
    half = np.sin(np.pi / 4)
    chain = (
        bags.Transform("base_footprint", "base_link", (0.0, 0.0, 0.1)),
        bags.Transform("base_link", "mast", (0.2, 0.1, 0.5), (0.0, 0.0, half, half)),
        bags.Transform("mast", "laser", (0.05, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0)),
    )
    assert short().odometry is not None
    path = floor.bag(tmp_path / "bag", "ros2", floor.scans(short()), floor.odometry(short()), floor.mounting(*chain))
    scanner = opened(path).recording.scanner
    pose = np.eye(4)
    for one in chain[1:]:  # from the odometry's base_link on
        pose = pose @ matrix(np.array([*one.place, *one.turn]))
    ranges = np.where(short().ranges[3] < 20, short().ranges[3].astype(np.float32), np.nan).astype(float)
    angles = np.float32(-np.pi / 2) + np.arange(len(ranges)) * float(floor.STEP)
    beams = np.stack((ranges * np.cos(angles), ranges * np.sin(angles), 0 * ranges, 1 + 0 * ranges), axis=-1)
    expected = (beams @ pose.T)[:, :2]
    points = scanner.points(opened(path).recording.ranges[3])
    expected = expected[np.isfinite(expected).all(axis=1)]
    np.testing.assert_allclose(points[::-1], expected, atol=1e-6)  # beams in the order of their angles
    assert (np.diff(scanner.angles) > 0).all()


def test_robot_toml_places_the_scanner_and_says_where_tf_differs(tmp_path: Path) -> None:
    path = whole(tmp_path)
    described(tmp_path / "bag", "pose = [0.2, 0.0, 0.1]\nmax_range = 12\nstep = 0.25")
    found = opened(path)
    np.testing.assert_array_equal(found.recording.scanner.pose, [0.2, 0.0, 0.1])
    assert found.recording.scanner.most == 12
    assert found.settings.step == 0.25
    assert len(found.remarks) == 1
    assert "tf has laser at x 0 m, y 0 m, heading 0 rad on base_link" in found.remarks[0]
    alone = floor.bag(tmp_path / "alone", "ros2", floor.scans(short()), floor.odometry(short()))
    (remark,) = opened(alone).remarks
    assert "tf does not tell where laser is on base_link: taken to be at its origin" in remark


@pytest.mark.parametrize(
    ("place", "turn", "words"),
    [
        ((0.0, 0.0, 0.0), (0.0, np.sin(0.4), 0.0, np.cos(0.4)), "tf has laser tilted by 46 degrees on base_link"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.5), "expected finite numbers and a quaternion of length 1"),
        ((np.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), "expected finite numbers and a quaternion of length 1"),
    ],
)
def test_a_transform_that_cannot_be_used_is_named(place: Any, turn: Any, words: str, tmp_path: Path) -> None:
    there = floor.mounting(bags.Transform("base_link", "laser", place, turn))
    path = floor.bag(tmp_path / "bag", "ros1", floor.scans(short()), floor.odometry(short()), there)
    assert words in refusal(open_scans, path)


def test_a_transform_of_something_else_may_be_anything(tmp_path: Path) -> None:
    arm = bags.Transform("base_link", "gripper", (np.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    there = floor.mounting(floor.LASER_ON_BASE, arm)
    path = floor.bag(tmp_path / "bag", "ros1", floor.scans(short()), floor.odometry(short()), there)
    assert opened(path).remarks == []
    moving = [one._replace(build=lambda new: {"transforms": [arm]}) for one in floor.by_tf(short())]
    streams = floor.scans(short()), floor.by_tf(short()), moving, floor.mounting()
    assert opened(floor.bag(tmp_path / "two", "ros2", *streams)).remarks == []
    loose = arm._replace(parent="odom")
    lost = [one._replace(build=lambda new: {"transforms": [loose]}) for one in floor.by_tf(short())]
    path = floor.bag(tmp_path / "three", "ros2", floor.scans(short()), lost)
    refused(r"from odom to gripper .* at 100\.0 s, is .*, expected finite numbers", open_scans, path)


def test_the_first_tf_of_ros_is_read(tmp_path: Path) -> None:
    old = [one._replace(type="tf/msg/tfMessage") for one in floor.by_tf(short())]
    found = opened(floor.bag(tmp_path / "bag", "ros1", floor.scans(short()), old, floor.mounting()))
    assert found.recording.notes["topics"]["odometry"] == "tf from odom to base_link"


def test_transforms_that_lead_in_a_circle_are_refused(tmp_path: Path) -> None:
    there = floor.mounting(bags.Transform("laser", "mast", (0, 0, 0)), bags.Transform("mast", "laser", (0, 0, 0)))
    path = floor.bag(tmp_path / "bag", "ros2", floor.scans(short()), floor.odometry(short()), there)
    refused("back to it, expected a tree", open_scans, path)


# --- odometry between its readings ------------------------------------------------------------------------------------


def test_odometry_is_interpolated_along_the_line_and_evenly_in_heading() -> None:
    readings = Poses(np.array([0.0, 1.0, 3.0]), np.array([[0.0, 0, 3.0], [2.0, 4.0, -3.0], [2.0, 5.0, -3.0]]))
    here, at = interpolated(readings, np.array([-0.1, 0.0, 0.25, 1.0, 2.0, 3.0, 3.1]), 1.5)
    assert here.tolist() == [False, True, True, True, False, True, False]
    np.testing.assert_array_equal(at[[1, 3, 5]], readings.poses)
    turn = 2 * np.pi - 6.0
    np.testing.assert_allclose(at[2], [0.5, 1.0, 3.0 + 0.25 * turn], atol=1e-12)
    assert interpolated(readings, np.array([2.0]), 2.0)[0].all()


def test_scans_count_as_taken_in_the_middle_of_their_sweep(tmp_path: Path) -> None:
    """The robot's pose at that time is half way between its readings, here."""
    beams = short().ranges.shape[1]
    sweep = 0.1
    found = opened(whole(tmp_path, time_increment=sweep / (beams - 1), scan_time=sweep))
    recording, odometry = found.recording, short().odometry
    np.testing.assert_allclose(recording.t, BEGIN + short().t[:-1] + sweep / 2, atol=1e-6)  # single precision
    middle = odometry[:-1, :2] + 0.25 * np.diff(odometry[:, :2], axis=0)
    np.testing.assert_allclose(recording.odometry[:, :2], middle, atol=1e-6)
    assert found.remarks == ["1 of 30 scans have no odometry within 1 s around them and are left out"]


@pytest.mark.parametrize("increment", [-1e-3, 1.0, np.nan])
def test_a_time_increment_in_other_units_is_not_used(increment: float, tmp_path: Path) -> None:
    found = opened(whole(tmp_path, time_increment=increment))
    np.testing.assert_allclose(found.recording.t, BEGIN + short().t, atol=1e-9)
    assert len(found.remarks) == 1
    assert "theirs count as taken at their stamps" in found.remarks[0]


def test_scans_where_odometry_is_missing_are_left_out_and_counted(tmp_path: Path) -> None:
    said = [one for k, one in enumerate(floor.odometry(short())) if not 10 <= k < 20]
    path = floor.bag(tmp_path / "bag", "ros1", floor.scans(short()), said, floor.mounting())
    found = opened(path)
    assert len(found.recording.t) == 20
    assert found.remarks == ["10 of 30 scans have no odometry within 1 s around them and are left out"]
    described(tmp_path / "bag", "max_gap = 3.0")
    assert len(opened(path).recording.t) == 30


def test_a_bag_without_odometry_goes_by_the_scans_alone(tmp_path: Path) -> None:
    path = floor.bag(tmp_path / "bag", "ros2", floor.scans(drive()))
    found = opened(path)
    assert found.recording.odometry is None
    assert any("has no odometry, neither nav_msgs/Odometry nor a transform of tf" in one for one in found.remarks)
    log = build(found).log
    assert log.notes["laser"]["wheels"] is False
    assert log.notes["topics"]["odometry"] == "none"
    assert len(log) > 25
    described(tmp_path / "bag", 'odometry = "wheels"')
    refused(r'has no odometry, .* for \[laser\] odometry = "wheels"; found /scan', open_scans, path)


def test_odometry_that_never_moves_is_none(tmp_path: Path) -> None:
    still = [bags.odometry(stamp, 1.0, 2.0, (0.0, 0.0, 0.0, 1.0)) for stamp in floor.stamps(short())]
    path = floor.bag(tmp_path / "bag", "ros2", floor.scans(short()), still, floor.mounting())
    found = opened(path)
    assert found.recording.odometry is None
    assert found.remarks == ["its odometry never moves: the front end goes by the scans alone"]
    described(tmp_path / "bag", 'odometry = "wheels"')
    refused(r'/odom never moves, expected \[laser\] odometry = "none"', open_scans, path)


def test_odometry_in_centimetres_is_refused(tmp_path: Path) -> None:
    """Every scan would be searched for within metres, which takes hours."""
    rows = zip(floor.stamps(short()), (short().odometry * [100.0, 100.0, 1.0]).tolist(), strict=True)
    far = [bags.odometry(stamp, x, y, floor.turned(heading)) for stamp, (x, y, heading) in rows]
    path = floor.bag(tmp_path / "bag", "ros2", floor.scans(short()), far, floor.mounting())
    refused(r"/odom goes at \d+\.?\d* m/s \(median .* perhaps it is in centimetres or mil", open_scans, path)
    described(tmp_path / "bag", 'odometry = "none"')
    assert opened(path).recording.odometry is None


# --- what a return is -------------------------------------------------------------------------------------------------


def test_what_is_no_return_is_none_however_it_is_said(tmp_path: Path) -> None:
    """NaN, infinite, beyond the scanner's limits or a SICK's code: the same points, with max_range 100, too."""
    missing = short().ranges > 20
    assert 50 < missing.sum() < missing.size / 2
    found = list[Array]()
    for number, said in enumerate((81.83, 81.91, np.nan, np.inf, -np.inf, 0.0, 90.0)):
        ranges = np.where(missing, said, short().ranges)
        folder = tmp_path / str(number)
        path = floor.bag(folder, "ros2", floor.scans(replace(short(), ranges=ranges), range_max=85.0))
        described(folder, "max_range = 100\nmin_range = 0.0")
        recording = opened(path).recording
        found.append(recording.scanner.points(recording.ranges[5]))
    assert len(found[0]) == int((~missing[5]).sum())
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


@pytest.mark.parametrize("rows", [slice(0, 8), slice(60, 75), slice(160, None)])
def test_scans_without_a_return_are_bridged_by_the_wheels(rows: slice, tmp_path: Path) -> None:
    ranges = drive().ranges.copy()
    ranges[rows] = np.inf
    log = build(opened(whole(tmp_path, drive=replace(drive(), ranges=ranges)))).log
    empty = len(drive().t[rows])
    assert log.notes["laser"]["lost"] >= empty - 1  # the first scan has nothing to match
    assert drive().odometry is not None
    way = between(drive().odometry[:-1], drive().odometry[1:])
    assert abs(np.hypot(*log.delta[1:, :2].T).sum() - np.hypot(*way[:, :2].T).sum()) < 1.0


def test_the_scanners_own_limits_hold_and_unset_ones_do_not(tmp_path: Path) -> None:
    for number, (limits, expected) in enumerate(
        [((0.5, 8.0), (0.5, 8.0)), ((0.0, 0.0), (0.15, 25.0)), ((0.0, np.inf), (0.15, 25.0)), ((5, 2), (0.15, 25.0))]
    ):
        said = floor.scans(short(), range_min=limits[0], range_max=limits[1])
        scanner = opened(floor.bag(tmp_path / str(number), "ros2", said)).recording.scanner
        assert (scanner.least, scanner.most) == expected


# --- what cannot be used ----------------------------------------------------------------------------------------------


def mostly(said: Streams, x: float, y: float, turn: Any, start: float = 0.0) -> Streams:
    """Odometry with other messages from the middle on, and `start` m away."""
    return [*said[:14], *(bags.odometry(one.stamp, x + start, y, turn) for one in said[14:])]


def restarted(said: Streams) -> Streams:
    """The clock begins again half way."""
    half = len(said) // 2
    return [*said[:half], *(one._replace(stamp=one.stamp - 3 * NS, received=one.stamp) for one in said[half:])]


S, W = floor.scans, floor.odometry
BEAMS, RANGES = "expected at least 2 beams at steps of an angle", "no range of topic /scan is between 0.15 and 25 m"
BACKWARDS = "s before the message received before it; expected one clock that goes forward"
UPRIGHT = (0, 0, 0, 1)
TWO_SCANS = "/rear (sensor_msgs/LaserScan, 30 messages), /scan (sensor_msgs/LaserScan, 30 messages), expected [laser]"
TWO_WAYS = "/filtered (nav_msgs/Odometry, 30 messages), /odom (nav_msgs/Odometry, 30 messages), expected [topics] o"
APART = "none of the 30 scans has odometry: scans are from 100.0 to 105.8 s, readings of /odom from 1100.0 to 1105.8 s"
FAULTS: list[tuple[Callable[[LaserRecording], Sequence[Streams]], str]] = [
    (lambda d: [W(d)], "has no topic with scans (sensor_msgs/LaserScan); found /odom"),
    (lambda d: [], "contains no messages, expected a recording"),
    (lambda d: [S(d)[:1], W(d)], "found 1 scans in topic /scan, expected at least 2"),
    (lambda d: [S(d), [one._replace(topic="/rear") for one in S(d)], W(d)], TWO_SCANS),
    (lambda d: [S(d), W(d), W(d, topic="/filtered")], TWO_WAYS),
    (lambda d: [S(d), floor.by_tf(d), floor.by_tf(d, child="cart")], "tf has the transforms odom to base_link, odom"),
    (lambda d: [[bags.scan(one.stamp, []) for one in S(d)], W(d)], "all 30 scans of topic /scan are empty, expected"),
    (lambda d: [S(d, angle_increment=0.0), W(d)], BEAMS),
    (lambda d: [S(d, angle_min=np.nan), W(d)], BEAMS),
    (lambda d: [S(d, angle_increment=1.0), W(d)], "expected at most a full turn, in radians"),
    (lambda d: [S(replace(d, ranges=np.full_like(d.ranges, 81.83))), W(d)], RANGES),
    (lambda d: [S(replace(d, ranges=np.full_like(d.ranges, np.nan))), W(d)], RANGES),
    (lambda d: [S(replace(d, ranges=1000 * d.ranges)), W(d)], RANGES),
    (lambda d: [restarted(S(d)), W(d)], BACKWARDS),
    (lambda d: [S(d), restarted(W(d))], BACKWARDS),
    (lambda d: [S(d), restarted(floor.by_tf(d))], "expected one clock that goes forward"),
    (lambda d: [S(d), [one._replace(stamp=one.stamp + 1000 * NS) for one in W(d)]], APART),
    (lambda d: [S(d), W(d)[:1]], "only one of the 30 scans has odometry"),
    (lambda d: [S(d), mostly(W(d), 0, 0, UPRIGHT, start=1e6)], "the odometry jumps by"),
    (lambda d: [S(d), mostly(W(d), np.nan, 0, UPRIGHT)], "16 of 30 messages of topic /odom cannot be used, expected m"),
    (lambda d: [S(d), mostly(W(d), 0, 0, (0, 0, 0, 0))], "has an orientation whose quaternion is of length 0, expect"),
]


@pytest.mark.parametrize(("streams", "words"), FAULTS)
def test_what_cannot_be_used_is_named(streams: Callable[..., Sequence[Streams]], words: str, tmp_path: Path) -> None:
    described(tmp_path / "beside", "")
    said = [one for stream in streams(short()) for one in stream]
    said.sort(key=lambda one: one.stamp if one.received is None else one.received)
    path = bags.write(tmp_path / "beside", "ros1", said)
    refused_at(path, words, open_scans, path)


def test_topics_are_chosen_by_robot_toml_or_by_options(tmp_path: Path) -> None:
    rear = [one._replace(topic="/rear") for one in floor.scans(replace(short(), ranges=short().ranges + 1))]
    odometry = floor.odometry(short()), floor.odometry(short(), topic="/o2")
    path = floor.bag(tmp_path / "bag", "ros2", floor.scans(short()), rear, *odometry)
    topics = ScanTopics("/rear", "o2")
    chosen = opened(path, None, topics).recording
    assert chosen.notes["topics"] == {"scan": "/rear", "odometry": "/o2"}
    described(tmp_path / "bag", 'topic = "/rear"', '[topics]\nodometry = "/o2"')
    again = opened(path).recording
    np.testing.assert_array_equal(again.ranges, chosen.ranges)
    assert opened(path, None, ScanTopics("/scan")).recording.notes["topics"] == {"scan": "/scan", "odometry": "/o2"}
    described(tmp_path / "bag", 'topic = "/front"')
    refused(r"has no topic '/front', which \[laser\] topic or the option scan names; found /o2", open_scans, path)


def test_scans_received_late_are_put_in_order_and_repeated_ones_left_out(tmp_path: Path) -> None:
    said = floor.scans(short())
    said[4:8] = [one._replace(received=said[8].stamp) for one in said[4:8][::-1]]
    said.insert(9, said[9])
    mixed = sorted([*said, *floor.odometry(short()), *floor.mounting()], key=lambda one: one.received or one.stamp)
    found = opened(bags.write(tmp_path, "ros1", mixed))
    np.testing.assert_allclose(found.recording.t, BEGIN + short().t, atol=1e-9)
    np.testing.assert_array_equal(found.recording.ranges, short().ranges.astype(np.float32))
    assert len(found.remarks) == 1
    assert "1 scans of topic /scan have the stamp of another one and are left out" in found.remarks[0]


@pytest.mark.parametrize("kind", first_quick(["ros1", "ros2", "mcap"]))
def test_a_damaged_bag_is_read_or_refused_with_a_sentence(kind: str, tmp_path: Path) -> None:
    path = whole(tmp_path, kind)

    def usable(found: OpenedScans | None) -> None:
        assert found is None or np.isfinite(found.recording.t).all()

    _, sentences = survivors(lambda _: open_scans(path), bags.file_of(path), 18, 1, usable)
    assert len(sentences) >= 4
