"""Scanners whose number of beams varies, and whose scans are empty at times: every scan counts at its own angles."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import bags
import floor_drives as floor
from carmen_files import flaser
from slamduel.bench.plan.load import load
from slamduel.core.se2 import Array
from slamduel.datasets.formats import log_folder
from slamduel.datasets.formats.carmen import Options, read
from slamduel.datasets.scans.open import ScanTopics, build, open_scans
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.laser.scanner import Scanner
from tiers import first_quick

STEP = float(floor.STEP)


@cache
def drive() -> LaserRecording:
    return floor.floor_drive(0.15)


class Cut(NamedTuple):
    """A scan without its first and its last beams."""

    first: int
    last: int

    @property
    def fields(self) -> dict[str, Any]:
        """The numbers of its message."""
        start = -np.pi / 2 + self.first * STEP
        return {"angle_min": start, "angle_increment": STEP}

    def of(self, ranges: Array) -> Array:
        """Its ranges."""
        return ranges[self.first : len(ranges) - self.last]


def cuts(number: int) -> list[Cut]:
    """Beams that vary from scan to scan as those of a scanner that counts by time: by one to five."""
    rng = np.random.default_rng(5)
    return [Cut(*rng.integers(0, 3, 2).tolist()) for _ in range(number)]


def scans(drive: LaserRecording, cut: Sequence[Cut]) -> list[bags.Said]:
    rows = zip(floor.stamps(drive), drive.ranges, cut, strict=True)
    return [bags.scan(stamp, one.of(ranges), **one.fields) for stamp, ranges, one in rows]


def points(recording: LaserRecording, number: int) -> Array:
    """The returns of a scan, in the order of their angles."""
    found = recording.points(number)
    return found[np.argsort(np.arctan2(found[:, 1], found[:, 0]))]


@pytest.mark.parametrize("kind", first_quick(bags.KINDS, 2))
def test_every_scan_counts_at_its_own_angles(kind: str, tmp_path: Path) -> None:
    """As exactly as a message has them; and the log is that of scans whose missing beams have no return."""
    whole, cut = drive(), cuts(len(drive().t))
    said = scans(whole, cut), floor.odometry(whole), floor.mounting()
    opened = open_scans(floor.bag(tmp_path / "bag", kind, *said))
    assert opened is not None
    assert len(opened.remarks) == 1
    least, most = (bound(len(one.of(whole.ranges[0])) for one in cut) for bound in (min, max))
    assert f"topic /scan: its scans have {least} to {most} beams: each counts at its own angles" in opened.remarks[0]
    assert opened.recording.beams == (least, most)
    blank = whole.ranges.astype(np.float32).astype(float)
    for row, one in zip(blank, cut, strict=True):
        row[: one.first] = np.nan
        row[len(row) - one.last :] = np.nan
    angles = -np.pi / 2 + STEP * np.arange(blank.shape[1])
    same = replace(whole, ranges=blank, scanner=Scanner(angles, np.zeros(3)))
    for k in (0, 7, 20):
        np.testing.assert_allclose(opened.recording.points(k), same.points(k), atol=1e-5)  # angles in single precision
    log, other = build(opened).log, build(opened._replace(recording=replace(same, t=opened.recording.t))).log
    assert len(log) == len(other) > 25
    np.testing.assert_allclose(log.delta[1:], other.delta[1:], atol=1e-3)
    assert log.scans is not None
    for k in (0, 3, 11):
        np.testing.assert_allclose(log.scans.points(k), other.scans.points(k), atol=1e-4)
    log_folder.write(tmp_path / "log", log, None)
    again = log_folder.read(tmp_path / "log").log
    np.testing.assert_array_equal(again.scans.points(5), log.scans.points(5))
    np.testing.assert_array_equal(again.head(9).scans.points(5), log.scans.points(5))


@pytest.mark.parametrize("turned", [False, True], ids=["upright", "upside down"])
@pytest.mark.parametrize("clockwise", [False, True])
def test_beams_that_vary_may_go_clockwise_or_hang_upside_down(clockwise: bool, turned: bool, tmp_path: Path) -> None:
    few = drive().taken(np.arange(len(drive().t)) < 6)
    cut = [Cut(k % 3, k % 2) for k in range(6)]
    said = scans(few, cut)
    if clockwise:
        rows = zip(floor.stamps(few), few.ranges, cut, strict=True)
        said = [
            bags.scan(
                stamp,
                one.of(ranges)[::-1],
                angle_min=one.fields["angle_min"] + STEP * (len(one.of(ranges)) - 1),
                angle_increment=-STEP,
            )
            for stamp, ranges, one in rows
        ]
    roll = (1.0, 0.0, 0.0, 0.0) if turned else (0.0, 0.0, 0.0, 1.0)
    there = floor.mounting(bags.Transform("base_link", "laser", (0.0, 0.0, 0.2), roll))
    opened = open_scans(floor.bag(tmp_path / "bag", "ros1", said, floor.odometry(few), there))
    assert opened is not None
    for k, one in enumerate(cut):
        ranges = one.of(few.ranges[k]).astype(np.float32).astype(float)
        angles = one.fields["angle_min"] + STEP * np.arange(len(ranges))
        kept = (ranges > 0.15) & (ranges < 25)
        y = np.sin(angles[kept]) * (-1 if turned else 1)
        expected = ranges[kept, None] * np.stack((np.cos(angles[kept]), y), axis=-1)
        order = np.argsort(np.arctan2(expected[:, 1], expected[:, 0]))
        np.testing.assert_allclose(points(opened.recording, k), expected[order], atol=1e-5)


def test_directions_may_vary_where_the_number_of_beams_does_not(tmp_path: Path) -> None:
    few = drive().taken(np.arange(len(drive().t)) < 6)
    rows = zip(floor.stamps(few), few.ranges, range(6), strict=True)
    said = [bags.scan(stamp, ranges, angle_min=-1.5 + 0.01 * k, angle_increment=STEP) for stamp, ranges, k in rows]
    opened = open_scans(floor.bag(tmp_path / "bag", "ros2", said, floor.odometry(few), floor.mounting()))
    assert opened is not None
    (remark,) = opened.remarks
    assert "the beams of its scans begin at -1.5 to -1.45 rad, in steps of 0.017453: each counts at its own" in remark
    angles = opened.recording.angles(3)
    assert angles is not None
    assert abs(angles[0] + 1.47) < 1e-6


def test_empty_scans_and_single_odd_ones_are_left_out_and_counted(tmp_path: Path) -> None:
    whole = drive()
    said = floor.scans(whole)
    said[:10] = [bags.scan(one.stamp, []) for one in said[:10]]
    said[14] = bags.scan(said[14].stamp, whole.ranges[14], angle_min=np.nan)
    said[15] = bags.scan(said[15].stamp, np.ones(2000), angle_increment=1e-3)
    said[16] = bags.scan(said[16].stamp, np.ones(1))
    opened = open_scans(floor.bag(tmp_path / "bag", "ros1", said, floor.odometry(whole), floor.mounting()))
    assert opened is not None
    assert len(opened.recording.t) == len(whole.t) - 13
    assert opened.recording.fans is None
    odd, empty = opened.remarks
    total = len(whole.t)
    assert f"3 of {total - 10} scans of topic /scan cannot be used and are left out; the first, scan 15, has 181" in odd
    assert f"10 of {total} scans of topic /scan are empty, or NaN in every beam, and are left out" in empty
    assert len(build(opened).log) > 20


@pytest.mark.parametrize("kind", first_quick(bags.KINDS, 2))
def test_of_several_echoes_the_first_counts(kind: str, tmp_path: Path) -> None:
    few = drive().taken(np.arange(len(drive().t)) < 6)
    plain = floor.scans(few)
    said = list[bags.Said]()
    for one, ranges in zip(plain, few.ranges, strict=True):
        beams = [[] if r > 20 else [r] if k % 2 else [r, r + 1, r + 2] for k, r in enumerate(ranges.tolist())]
        said.append(bags.echoes(one, beams))
    opened = open_scans(floor.bag(tmp_path / "echoes", kind, said, floor.odometry(few), floor.mounting()))
    single = open_scans(floor.bag(tmp_path / "single", kind, plain, floor.odometry(few), floor.mounting()))
    assert opened is not None
    assert single is not None
    assert opened.remarks == []
    assert opened.recording.notes["echo"] == "of several echoes of a beam, the first"
    assert "echo" not in single.recording.notes
    for k in range(6):
        np.testing.assert_array_equal(opened.recording.points(k), single.recording.points(k))
    other = [bags.echoes(one, [[9.0]] * 181, "/echoes") for one in plain]
    both = floor.bag(tmp_path / "both", kind, plain, other, floor.odometry(few), floor.mounting())
    assert open_scans(both).recording.notes["topics"]["scan"] == "/scan"  # pyright: ignore[reportOptionalMemberAccess]
    named = open_scans(both, None, ScanTopics("/echoes"))
    assert named is not None
    assert (named.recording.ranges == 9).all()


def test_a_carmen_log_may_have_scans_of_any_number_of_beams(tmp_path: Path) -> None:
    """ROBOTLASER1 says where its beams are; FLASER's are over half a circle, however many there are."""
    whole, cut = drive(), cuts(len(drive().t))
    assert whole.odometry is not None
    lines = list[str]()
    for k, (t, one) in enumerate(zip(whole.t.tolist(), cut, strict=True)):
        kept = one.of(whole.ranges[k]) if k != 2 else np.zeros(0)
        place = " ".join(map(repr, whole.odometry[k].tolist()))
        words = " ".join(f"{r:.4f}" for r in kept)
        start = repr(-np.pi / 2 + np.pi / 180 * one.first)
        beams = f"{len(kept)} {words} 0 {place} {place} 0 0 0 0 0 {t} host {t}"
        lines.append(f"ROBOTLASER1 0 {start} 3.14 {np.pi / 180!r} 81.9 0.01 0 {beams}")
    path = tmp_path / "drive.clf"
    path.write_text("\n".join(lines))
    recording, remarks = read(path, Options())
    assert len(recording.t) == len(whole.t) - 1
    assert f"1 of {len(whole.t)} scans are empty and are left out" in remarks
    assert any("beams: each counts at its own angles" in remark for remark in remarks)
    row = 9
    ranges = cut[row + 1].of(whole.ranges[row + 1])
    angles = -np.pi / 2 + np.pi / 180 * (cut[row + 1].first + np.arange(len(ranges), dtype=np.float64))
    expected = Scanner(angles, np.zeros(3)).points(np.round(ranges, 4))
    np.testing.assert_allclose(recording.points(row), expected, atol=1e-9)
    log, _ = load(str(path))
    way, exact = (
        np.hypot(*one.delta[1:, :2].T).sum() for one in (log, load(str(floor.carmen(tmp_path / "all.clf", whole)))[0])
    )
    assert abs(way - exact) < 0.05 * exact


@pytest.mark.parametrize("beams", [179, 180, 181, 182])
def test_beams_of_flaser_lines_lie_as_in_a_log_of_that_number_alone(beams: int, tmp_path: Path) -> None:
    """A scan looks at a wall straight ahead, 2 m away."""
    lines = list[str]()
    for k, number in enumerate((180, beams, beams)):
        step = np.pi / (number - number % 2)
        angles = -np.pi / 2 + step * np.arange(number)
        ranges = np.where(np.abs(angles) < 1.2, 2 / np.cos(angles), 50.0)
        lines.append(flaser(float(k), ranges, np.array([0.1 * k, 0.0, 0.0])))
    (tmp_path / "wall.clf").write_text("\n".join(lines))
    recording, _ = read(tmp_path / "wall.clf", Options())
    for k in range(3):
        np.testing.assert_allclose(recording.points(k)[:, 0], 2.0, atol=0.01)
