"""Single bad messages of a bag of laser scans: left out and counted, and the log is as if they had not been sent."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import bags
import floor_drives as floor
from floor_drives import BEGIN, NS
from refusals import refusal, refused
from slamduel.datasets.bags.clock import astray
from slamduel.datasets.bags.columns import no_poses
from slamduel.datasets.scans.open import OpenedScans, open_scans
from slamduel.frontend.laser.recording import LaserRecording
from tiers import first_quick

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
Streams = Sequence[bags.Said]


@cache
def drive() -> LaserRecording:
    return floor.floor_drive(0.15)


def opened(path: Path) -> OpenedScans:
    found = open_scans(path)
    assert found is not None
    return found


def stamped(one: bags.Said, stamp: int) -> bags.Said:
    """The message with another stamp, received at the same time."""
    return one._replace(stamp=stamp, received=one.stamp)


def recorded(folder: Path, kind: str, *streams: Streams) -> Path:
    """A bag in the order of reception."""
    said = [one for stream in streams for one in stream]
    said.sort(key=lambda one: one.stamp if one.received is None else one.received)
    folder.mkdir(parents=True)
    return bags.write(folder, kind, said)


BAD: dict[str, Callable[[bags.Said], bags.Said]] = {
    "NaN": lambda one: bags.odometry(one.stamp, np.nan, 0.0, UPRIGHT),
    "infinite": lambda one: bags.odometry(one.stamp, 0.0, -np.inf, UPRIGHT),
    "1e256": lambda one: bags.odometry(one.stamp, 1e256, 1e256, UPRIGHT),
    "at the origin": lambda one: bags.odometry(one.stamp, -30.0, -20.0, UPRIGHT),
    "a million": lambda one: bags.odometry(one.stamp, 1e6, 0.0, UPRIGHT),
    "no quaternion": lambda one: bags.odometry(one.stamp, 1.0, 0.0, (0.0, 0.0, 0.0, 0.0)),
    "NaN quaternion": lambda one: bags.odometry(one.stamp, 1.0, 0.0, (0.0, 0.0, np.nan, 1.0)),
    "on its side": lambda one: bags.odometry(one.stamp, 1.0, 0.0, (0.8, 0.0, 0.0, 0.6)),
    "years later": lambda one: stamped(one, one.stamp + 2 * 10**9 * NS),
    "an hour later": lambda one: stamped(one, one.stamp + 3600 * NS),
    "minutes earlier": lambda one: stamped(one, one.stamp - 90 * NS),
    "a minute later": lambda one: stamped(one, one.stamp + 65 * NS),
    "1970": lambda one: stamped(one, 5),
}


@pytest.mark.parametrize("kind", first_quick(["ros2", "ros1", "mcap"]))
@pytest.mark.parametrize("by_tf", [False, True], ids=["odometry", "tf"])
@pytest.mark.parametrize("bad", BAD)
def test_bad_odometry_is_left_out_and_counted(bad: str, by_tf: bool, kind: str, tmp_path: Path) -> None:
    """Wherever it is: the others are interpolated to the scans' times as if it had not been sent."""
    whole = floor.by_tf(drive()) if by_tf else floor.odometry(drive())
    rows = (5, 30) if bad == "at the origin" else (0, 5, 30)  # where a robot may start
    spoilt = list(whole)
    for row in rows:
        one = BAD[bad](whole[row])
        if by_tf:
            one = as_tf(one)
        spoilt[row] = one
    kept = [one for row, one in enumerate(whole) if row not in rows]
    found = opened(recorded(tmp_path / "bad", kind, floor.scans(drive()), spoilt, floor.mounting()))
    expected = opened(recorded(tmp_path / "good", kind, floor.scans(drive()), kept, floor.mounting()))
    np.testing.assert_array_equal(found.recording.t, expected.recording.t)
    assert found.recording.odometry is not None
    assert expected.recording.odometry is not None
    np.testing.assert_allclose(found.recording.odometry, expected.recording.odometry, atol=1e-12)
    new = [one for one in found.remarks if one.replace("/bad/", "/good/") not in expected.remarks]
    assert len(new) == 1
    assert f"{len(rows)} of {len(whole)} {'transforms' if by_tf else 'messages'}" in new[0]
    assert "cannot be used and are left out; the first, " in new[0]


def as_tf(one: bags.Said) -> bags.Said:
    """The same pose as a transform."""
    values: list[tuple[float, ...]] = []

    def noted(name: str, *parts: object) -> object:
        if name.endswith(("Point", "Quaternion")):
            values.append(tuple(float(str(part)) for part in parts))
        return object()

    if one.type != bags.ODOMETRY:
        return one
    one.build(noted)
    (place, turn), at = sorted(values[:2], key=len), one
    transform = bags.Transform("odom", "base_link", (place[0], place[1], 0.0), (turn[0], turn[1], turn[2], turn[3]))
    return bags.transforms(at.stamp, transform)


def test_scans_at_absurd_times_or_without_a_number_are_left_out(tmp_path: Path) -> None:
    whole = floor.scans(drive())
    ranges = drive().ranges.copy()
    ranges[12] = np.nan
    spoilt = floor.scans(replace(drive(), ranges=ranges))
    spoilt[0] = stamped(whole[0], whole[0].stamp + 10**8 * NS)
    spoilt[7] = stamped(whole[7], whole[7].stamp - 10 * NS)
    spoilt[20] = stamped(whole[20], whole[20].stamp + 10 * NS)
    found = opened(recorded(tmp_path / "bag", "ros1", spoilt, floor.odometry(drive()), floor.mounting()))
    kept = [row for row in range(len(drive().t)) if row not in (0, 7, 12, 20)]
    np.testing.assert_allclose(found.recording.t, BEGIN + drive().t[kept], atol=1e-9)
    total = len(whole)
    first, second = found.remarks
    assert (
        f"3 of {total} scans of topic /scan cannot be used and are left out; the first, scan 1, is stamped 1" in first
    )
    assert f"1 of {total} scans of topic /scan are empty, or NaN in every beam, and are left out" in second


def test_scans_of_another_scanner_in_the_same_topic_are_left_out(tmp_path: Path) -> None:
    """Their place on the robot, and most of their beams, are others."""
    front = floor.scans(drive())
    rear = [one._replace(frame="rear", stamp=one.stamp + 10**7) for one in front[::2]]
    said = sorted([*front, *rear], key=lambda one: one.stamp)
    found = opened(recorded(tmp_path / "bag", "mcap", said, floor.odometry(drive()), floor.mounting()))
    np.testing.assert_allclose(found.recording.t, BEGIN + drive().t, atol=1e-9)
    (remark,) = found.remarks
    assert (
        f"{len(rear)} of {len(said)} scans of topic /scan cannot be used and are left out; the first, scan 2" in remark
    )
    assert "is of the frame 'rear', most are of 'laser'" in remark


def test_the_scanners_place_is_that_of_the_sound_transforms(tmp_path: Path) -> None:
    said = [bags.transforms(one.stamp, floor.LASER_ON_BASE) for one in floor.odometry(drive())]
    said[9] = bags.transforms(said[9].stamp, floor.LASER_ON_BASE._replace(place=(np.nan, 0.0, 0.0)))
    found = opened(recorded(tmp_path / "bag", "ros2", floor.scans(drive()), floor.odometry(drive()), said))
    (remark,) = found.remarks
    assert f"1 of {len(said)} transforms from base_link to laser in topic /tf cannot be used and are left out" in remark
    np.testing.assert_array_equal(found.recording.scanner.pose, [0, 0, 0])


def test_a_robot_that_turns_round_between_two_messages_is_somewhere() -> None:
    """Odometry of 1 Hz that stood for most of the time, with the noise of its last digits."""
    x = np.array([0, 1e-9, 0, 1e-9, 0, 1e-9, 0, 1.5, 0, 1.5, 0, 1e-9, 0])
    poses = np.column_stack((x, np.zeros((len(x), 4)), np.ones(len(x))))
    assert no_poses(poses, np.arange(13.0)) == {}
    assert no_poses(poses, 0.02 * np.arange(13.0)).keys() == {7, 8, 9}


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_more_than_half_are_refused_with_their_number(share: float, tmp_path: Path) -> None:
    whole = floor.odometry(drive())
    many = round(share * len(whole))
    spoilt = [*(BAD["NaN"](one) for one in whole[:many]), *whole[many:]]
    path = recorded(tmp_path / "bag", "ros2", floor.scans(drive()), spoilt, floor.mounting())
    said = f"{many} of {len(whole)} messages of topic /odom cannot be used"
    if share < 0.5:
        assert any(said in remark for remark in opened(path).remarks)
    else:
        assert f"{said}, expected most of them to be sound; the first, message 1, at 100 s, has" in refusal(
            open_scans, path
        )


def test_a_clock_that_is_set_is_no_single_stamp(tmp_path: Path) -> None:
    whole = floor.odometry(drive())
    half = len(whole) // 2
    for number, (shift, every) in enumerate(((-20, 1), (-2, 1), (-3, 4))):
        said = [*whole[:half], *(stamped(one, one.stamp + shift * NS) for one in whole[half:])][::every]
        path = recorded(tmp_path / str(number), "ros1", floor.scans(drive()), said, floor.mounting())
        refused("before the message received before it; expected one clock that goes forward", open_scans, path)


def test_messages_that_overtake_each_other_are_not_astray() -> None:
    rng = np.random.default_rng(2)
    stamps = (np.arange(200) * NS // 10 + rng.integers(0, NS // 2, 200)).tolist()
    received = (np.arange(200) * NS // 10).tolist()
    assert astray(stamps, received) == {}
    assert astray([*stamps[:50], stamps[50] + 100 * NS, *stamps[51:]], received).keys() == {50}
    assert astray([], []) == astray([4], [4]) == astray([4, 10**18], [4, 5]) == {}
    late = [*received[:-1], received[-1] + 3600 * NS]  # the last one waited for an hour, in a queue
    assert astray(received, late) == astray(late, late) == {}
    assert astray(late, received).keys() == {199}
    days = [k * 10**14 for k in range(6)]  # 28 hours apart: none is like the others
    assert len(astray(days, days)) == 5
