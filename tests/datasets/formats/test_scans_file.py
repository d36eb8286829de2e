"""Scans beside a log: what is written is read, poses between steps are the front end's, and a damaged file is named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import floor_drives as floor
from slamduel.datasets.formats.scans_file import NAME, Scans, read_scans, scans_of, write_scans
from slamduel.frontend.errors import InputError
from slamduel.frontend.laser.front_end import FrontEnd
from slamduel.frontend.laser.recording import LaserRecording, build_log
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.se2 import between, compose

Driven = tuple[LaserRecording, FrontEnd]


@pytest.fixture(scope="module")
def driven() -> Driven:
    recording, found = floor.floor_drive(0.2), list[FrontEnd]()
    build_log(recording, Settings(), found.append)
    return recording, found[0]


def test_what_is_written_is_read(driven: Driven, tmp_path: Path) -> None:
    scans = scans_of(*driven)
    write_scans(tmp_path, scans)
    again = read_scans(tmp_path, len(driven[1].steps))
    assert again is not None
    for name in Scans._fields:
        expected = getattr(scans, name)
        np.testing.assert_array_equal(
            getattr(again, name), expected.astype(np.float32) if name == "ranges" else expected
        )
    assert [path.name for path in tmp_path.iterdir()] == [NAME]
    assert read_scans(tmp_path / "elsewhere", 3) is None


def test_scans_between_steps_are_where_the_front_end_has_them(driven: Driven) -> None:
    """Also on a path that nobody has driven: a scan at a step is at the step, and one in between lies in between."""
    recording, front_end = driven
    scans = scans_of(recording, front_end)
    estimate = np.array(front_end.estimate)
    path = compose(recording.prior.pose, between(estimate[0], estimate))
    np.testing.assert_allclose(scans.poses(path), scans.estimate, atol=1e-9)
    rng = np.random.default_rng(1)
    bent = path + rng.normal(0, 0.02, path.shape)
    poses = scans.poses(bent)
    own = [step.scan for step in front_end.steps]
    np.testing.assert_allclose(poses[own], bent, atol=1e-12)
    assert np.abs(poses - scans.estimate).max() < 0.2
    inside = int(own[3]) + 1
    assert scans.step[inside] == 3
    by_hand = compose(bent[3], between(front_end.steps[3].pose, front_end.path[inside]))
    other = compose(bent[4], between(front_end.steps[4].pose, front_end.path[inside]))
    share = (scans.t[inside] - front_end.steps[3].t) / (front_end.steps[4].t - front_end.steps[3].t)
    assert 0 < share < 1
    np.testing.assert_allclose(poses[inside], compose(by_hand, share * between(by_hand, other)), atol=1e-12)


def test_the_points_are_those_of_the_scanner(driven: Driven) -> None:
    recording, front_end = driven
    scans = scans_of(recording, front_end)
    np.testing.assert_array_equal(scans.points(7), recording.scanner.points(recording.ranges[7]))
    assert len(scans.points(7)) > 100


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.pop("angles"), "angles is not a file in the archive, expected t, ranges, angles, scanner"),
        (lambda c: c.update(angles=c["angles"][1:]), r"ranges is float32 of the shape .*, expected numbers of"),
        (lambda c: c.update(step=c["step"] + 0.5), "step is float64 of the shape .*, expected whole numbers of"),
        (lambda c: c.update(step=c["step"] + 1), "its scans are of the steps 1 to .*, expected each of the log's 0 to"),
        (lambda c: c.update(step=c["step"][::-1]), "its scans are of the steps 0 to .*, in order"),
        (lambda c: c.update(before=c["before"] * np.nan), "before has what is not a number, expected finite ones"),
        (lambda c: c.update(t=c["t"][::-1]), "scans whose times do not increase, expected them in the order of time"),
        (lambda c: c.update(estimate=np.array(["a"])), "estimate is <U1 of the shape"),
        (lambda c: c.update(scanner=np.array([{}], object)), "is damaged or no file of scans"),
        (lambda c: c.update(ranges=3.0), "ranges is float64 of the shape"),
    ],
)
def test_a_file_of_something_else_is_named(change: Any, words: str, driven: Driven, tmp_path: Path) -> None:
    scans = scans_of(*driven)
    columns: dict[str, Any] = scans._asdict() | {"ranges": scans.ranges.astype(np.float32)}
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
