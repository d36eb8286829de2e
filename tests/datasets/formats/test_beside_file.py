"""Scans and clouds beside a log: what is written is read, poses between steps are right, a damaged file is named."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import floor_drives as floor
from fuzzing import survivors
from refusals import refused
from slamduel.core.beside import Clouds, columns_of
from slamduel.core.factors import Dataset, Log, Prior
from slamduel.core.relations import Anchors
from slamduel.core.se2 import between, compose
from slamduel.datasets import archive
from slamduel.datasets.formats import log_folder
from slamduel.datasets.formats.beside_file import FILES, read_beside, write_beside
from slamduel.frontend.laser.front_end import FrontEnd
from slamduel.frontend.laser.log import log_of, scans_of
from slamduel.frontend.laser.recording import LaserRecording, matched, placed
from slamduel.frontend.laser.settings import Settings

Driven = tuple[LaserRecording, FrontEnd]


@pytest.fixture(scope="module")
def driven() -> Driven:
    recording = floor.floor_drive(0.2)
    return recording, matched(recording, Settings())


def test_what_is_written_is_read(driven: Driven, tmp_path: Path) -> None:
    log = log_of(*driven)
    write_beside(tmp_path, log)
    again = read_beside(tmp_path, "scans", len(log))
    assert log.scans is not None
    for name, column in columns_of("scans", log.scans).items():
        np.testing.assert_array_equal(columns_of("scans", again)[name], column)
    assert [path.name for path in tmp_path.iterdir()] == [FILES["scans"]]
    assert read_beside(tmp_path, "clouds", len(log)) is None
    assert read_beside(tmp_path / "elsewhere", "scans", 3) is None


def test_they_come_with_the_folder_of_the_log(driven: Driven, tmp_path: Path) -> None:
    log = log_of(*driven)
    log_folder.write(tmp_path / "log", log, None)
    again = log_folder.read(tmp_path / "log").log
    np.testing.assert_array_equal(again.scans.ranges, log.scans.ranges)
    assert again.digest == log.digest
    (tmp_path / "log" / FILES["scans"]).unlink()
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


# --- clouds -----------------------------------------------------------------------------------------------------------

STEPS = 3


def clouds() -> Clouds:
    """Three clouds of points, the second one without any."""
    rng = np.random.default_rng(3)
    origin = np.zeros((STEPS, 3))
    points = rng.integers(-900, 900, (70, 3)).astype(np.int16)
    colours = rng.integers(0, 256, (70, 3)).astype(np.uint8)
    at = Anchors(np.arange(STEPS), origin, origin, np.zeros(STEPS))
    return Clouds(at, np.array([0, 40, 40, 70]), points, colours, np.array([0.1, 0.0, 0.7]))


def standing(beside: Clouds) -> Log:
    """A log of three steps with clouds beside it."""
    n, none = STEPS, np.zeros(0, np.int64)
    log = Log.from_arrays(
        "depth", Prior(np.zeros(3), np.eye(3)), np.arange(3.0), np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)),
        none, none, np.zeros((0, 2)), np.zeros((0, 2, 2)),
    )  # fmt: skip
    return replace(log, clouds=beside)


def same(one: Clouds, other: Clouds | None) -> None:
    assert other is not None
    for name, column in columns_of("clouds", one).items():
        found = columns_of("clouds", other)[name]
        np.testing.assert_array_equal(found, column)
        assert found.dtype == column.dtype


def test_clouds_come_with_the_folder_and_the_archive_of_a_log_and_are_no_part_of_its_digest(tmp_path: Path) -> None:
    log = standing(clouds())
    log_folder.write(tmp_path / "log", log, None)
    again = log_folder.read(tmp_path / "log").log
    same(clouds(), again.clouds)
    assert again.scans is None
    assert again.digest == log.digest == replace(log, clouds=None).digest
    archive.save(tmp_path / "kept.npz", Dataset(log, None))
    same(clouds(), archive.load(tmp_path / "kept.npz").log.clouds)
    assert archive.load_log(tmp_path / "kept.npz").clouds is None  # a worker has no use for them
    (tmp_path / "log" / FILES["clouds"]).unlink()
    assert log_folder.read(tmp_path / "log").log.clouds is None


def test_points_and_colours_are_those_of_each_cloud() -> None:
    found = clouds()
    np.testing.assert_array_equal(found.xyz(0), 0.005 * found.points[:40])
    assert found.xyz(1).shape == (0, 3)
    np.testing.assert_array_equal(found.rgb(2), found.colours[40:])


OTHERS: list[tuple[str, Any, str]] = [
    ("scans", lambda c: c.pop("angles"), "angles is not a file in the archive, expected step, since, until, share, r"),
    ("scans", lambda c: c.update(angles=c["angles"][1:]), "ranges is float32 of the shape .*, expected numbers of"),
    ("scans", lambda c: c.update(step=c["step"] + 0.5), "step is float64 of the shape .*, expected whole numbers of"),
    ("scans", lambda c: c.update(step=c["step"] + 1), "its scans are of the steps 1 to .*, expected some of the log's"),
    ("scans", lambda c: c.update(since=c["since"] * np.nan), "since has what is not a number, expected finite ones"),
    ("scans", lambda c: c.update(share=np.array(["a"])), "share is <U1 of the shape"),
    ("scans", lambda c: c.update(scanner=np.array([{}], object)), "is damaged or no file of scans"),
    ("clouds", lambda c: c.update(colours=c["colours"][1:]), r"colours is uint8 of the shape \(69, 3\), .* \(70, 3\)"),
    ("clouds", lambda c: c.update(colours=c["colours"].astype("u2")), "colours is uint16 .* numbers of a byte of"),
    ("clouds", lambda c: c.update(points=c["points"] * 0.005), "points is float64 .*, expected whole numbers of"),
    ("clouds", lambda c: c.update(points=np.int16(3)), "points is int16 of the shape"),
    ("clouds", lambda c: c.update(first=c["first"][:-1]), r"first is int64 of the shape \(3,\), expected .* of \(4,\)"),
    ("clouds", lambda c: c.update(first=c["first"][::-1].copy()), "first goes from 70 to 0, expected a row that rises"),
    ("clouds", lambda c: c.update(first=np.array([0, 60, 40, 70])), "first goes from 0 to 70, expected a row that"),
    ("clouds", lambda c: c.update(step=c["step"] + 1), "its clouds are of the steps 1 to 3, expected .* 0 to 2"),
]


def beside(kind: str, driven: Driven) -> Log:
    """A log with scans or clouds beside it."""
    return log_of(*driven) if kind == "scans" else standing(clouds())


@pytest.mark.parametrize(("kind", "change", "words"), OTHERS)
def test_a_file_of_something_else_is_named(kind: str, change: Any, words: str, driven: Driven, tmp_path: Path) -> None:
    log, file = beside(kind, driven), tmp_path / "log" / FILES[kind]
    columns: dict[str, Any] = columns_of(kind, getattr(log, kind))
    change(columns)
    log_folder.write(tmp_path / "log", log, None)
    np.savez(file, **columns)
    refused(f"^{file}.*{words}", log_folder.read, tmp_path / "log")


@pytest.mark.parametrize("kind", FILES)
def test_a_damaged_file_is_read_or_refused(kind: Any, driven: Driven, tmp_path: Path) -> None:
    log = beside(kind, driven)
    write_beside(tmp_path, log)
    _, sentences = survivors(lambda file: read_beside(file.parent, kind, len(log)), tmp_path / FILES[kind], 30, 0)
    assert len(sentences) > 15
