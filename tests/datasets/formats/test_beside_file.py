"""Scans beside a log: what is written is read, poses between steps are the front end's, and a damaged file is named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import floor_drives as floor
from slamduel.datasets.formats import log_folder
from slamduel.datasets.formats.scans_file import NAME, read_scans, write_scans
from slamduel.frontend.beside import scan_columns
from slamduel.frontend.errors import InputError
from slamduel.frontend.laser.front_end import FrontEnd
from slamduel.frontend.laser.log import log_of, scans_of
from slamduel.frontend.laser.recording import LaserRecording, matched, placed
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.se2 import between, compose

Driven = tuple[LaserRecording, FrontEnd]


@pytest.fixture(scope="module")
def driven() -> Driven:
    recording = floor.floor_drive(0.2)
    return recording, matched(recording, Settings())


def test_what_is_written_is_read(driven: Driven, tmp_path: Path) -> None:
    scans = scans_of(*driven)
    write_scans(tmp_path, scans)
    again = read_scans(tmp_path, len(driven[1].steps))
    assert again is not None
    for name, column in scan_columns(scans).items():
        np.testing.assert_array_equal(scan_columns(again)[name], column)
    assert [path.name for path in tmp_path.iterdir()] == [NAME]
    assert read_scans(tmp_path / "elsewhere", 3) is None


def test_they_come_with_the_folder_of_the_log(driven: Driven, tmp_path: Path) -> None:
    log = log_of(*driven)
    assert log.scans is not None
    log_folder.write(tmp_path / "log", log, None)
    again = log_folder.read(tmp_path / "log").log
    assert again.scans is not None
    np.testing.assert_array_equal(again.scans.ranges, log.scans.ranges)
    assert again.digest == log.digest
    (tmp_path / "log" / NAME).unlink()
    assert log_folder.read(tmp_path / "log").log.scans is None


def own(driven: Driven) -> list[int]:
    """The scans that are kept, by their numbers."""
    front_end = driven[1]
    kept, last = [0], front_end.path[0]
    for k, pose in enumerate(front_end.path):
        off = between(last, pose)
        if np.hypot(off[0], off[1]) > 0.1 or abs(off[2]) > 0.1:
            kept.append(k)
            last = pose
    return kept


def test_scans_between_steps_are_where_the_front_end_has_them(driven: Driven) -> None:
    """Also on a path that nobody has driven: a scan at a step is at the step, and one in between lies in between."""
    recording, front_end = driven
    scans, kept = scans_of(recording, front_end), own(driven)
    assert len(scans.ranges) == len(kept)
    estimate = np.array(front_end.estimate)
    path = compose(recording.prior.pose, between(estimate[0], estimate))
    np.testing.assert_allclose(scans.at.along(path), placed(recording, front_end)[kept], atol=1e-9)
    rng = np.random.default_rng(1)
    bent = path + rng.normal(0, 0.02, path.shape)
    poses = scans.at.along(bent)
    steps = {step.scan: number for number, step in enumerate(front_end.steps)}
    checked = 0
    for row, scan in enumerate(kept):
        if scan in steps:
            np.testing.assert_allclose(poses[row], bent[steps[scan]], atol=1e-12)
            continue
        k = max(number for first, number in steps.items() if first < scan)
        if k + 1 == len(front_end.steps):
            continue
        one = compose(bent[k], between(front_end.steps[k].pose, front_end.path[scan]))
        other = compose(bent[k + 1], between(front_end.steps[k + 1].pose, front_end.path[scan]))
        share = (recording.t[scan] - front_end.steps[k].t) / (front_end.steps[k + 1].t - front_end.steps[k].t)
        assert 0 < share < 1
        np.testing.assert_allclose(poses[row], compose(one, share * between(one, other)), atol=1e-12)
        checked += 1
    assert checked > 20


def test_the_points_are_those_of_the_scanner(driven: Driven) -> None:
    recording, front_end = driven
    scans, kept = scans_of(recording, front_end), own(driven)
    np.testing.assert_allclose(scans.points(7), recording.scanner.points(recording.ranges[kept[7]]), atol=2e-6)
    assert len(scans.points(7)) > 100


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.pop("angles"), "angles is not a file in the archive, expected step, since, until, share, ranges"),
        (lambda c: c.update(angles=c["angles"][1:]), r"ranges is float32 of the shape .*, expected numbers of"),
        (lambda c: c.update(step=c["step"] + 0.5), "step is float64 of the shape .*, expected whole numbers of"),
        (lambda c: c.update(step=c["step"] + 1), "its scans are of the steps 1 to .*, expected some of the log's 0 to"),
        (lambda c: c.update(since=c["since"] * np.nan), "since has what is not a number, expected finite ones"),
        (lambda c: c.update(share=np.array(["a"])), "share is <U1 of the shape"),
        (lambda c: c.update(scanner=np.array([{}], object)), "is damaged or no file of scans"),
        (lambda c: c.update(ranges=3.0), "ranges is float64 of the shape"),
    ],
)
def test_a_file_of_something_else_is_named(change: Any, words: str, driven: Driven, tmp_path: Path) -> None:
    columns: dict[str, Any] = scan_columns(scans_of(*driven))
    change(columns)
    np.savez(tmp_path / NAME, **columns)
    with pytest.raises(InputError, match=words) as error:
        read_scans(tmp_path, len(driven[1].steps))
    assert str(error.value).startswith(str(tmp_path / NAME))
    assert "\n" not in str(error.value)


def test_a_damaged_file_is_read_or_refused(driven: Driven, tmp_path: Path) -> None:
    write_scans(tmp_path, scans_of(*driven))
    content = (tmp_path / NAME).read_bytes()
    rng, refused = np.random.default_rng(0), 0
    for case in range(30):
        broken = bytearray(content if case % 3 else content[: int(rng.integers(len(content)))])
        broken[int(rng.integers(len(broken)))] ^= 1 << int(rng.integers(8))
        (tmp_path / NAME).write_bytes(broken)
        try:
            read_scans(tmp_path, len(driven[1].steps))
        except InputError:
            refused += 1
    assert refused > 20
