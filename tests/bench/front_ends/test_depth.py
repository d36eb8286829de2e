"""`bench speed --frontend --only depth`: its figures, against others worked out here."""

import tracemalloc
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from command import refused
from csv_rows import csv_rows
from matrix_errors import judges_as_matrices_do, matrix
from slamduel.bench.cli import main
from slamduel.bench.front_ends import depth
from slamduel.bench.front_ends.depth import (
    DepthDrive,
    DepthExtent,
    DepthStudy,
    consistency,
    frame_cost,
    loop_cost,
    pair_costs,
)
from slamduel.bench.front_ends.depth_references import matches, motion
from slamduel.bench.front_ends.depth_timed import PARTS, Timed, held
from slamduel.core.se2 import Array, Ints
from slamduel.datasets.recordings.write_depth import write_depth
from slamduel.datasets.worlds.depth_room import Options, depth_room, record, shots_of
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.depth.features import Features
from slamduel.frontend.depth.log import log_of
from slamduel.frontend.depth.points import points_of
from slamduel.frontend.depth.settings import Settings

SHORT, CLOSED = 0.2, 1.2
"""Laps: without a loop, and with some."""


@cache
def drives(laps: float) -> list[DepthDrive]:
    return DepthStudy(3, DepthExtent(1, laps, 200)).drives(lambda: None)


def test_a_timed_front_end_makes_the_log_that_a_run_gets() -> None:
    made = depth_room(Options(laps=SHORT), np.random.default_rng([3, 0, 0])).log
    (drive,) = drives(SHORT)
    assert log_of(drive.recording, drive.front_end).digest == made.digest


@pytest.mark.parametrize("laps", [SHORT, pytest.param(CLOSED, marks=pytest.mark.slow)])
def test_errors_and_nees_are_those_of_homogeneous_matrices(laps: float) -> None:
    (drive,) = drives(laps)
    true = {t: matrix(pose) for t, pose in zip(drive.truth.t.tolist(), drive.truth.poses, strict=True)}
    rows = {row.kind: row for row in consistency([drive])}
    assert list(rows) == (["neighbours"] if laps == SHORT else ["neighbours", "loop"])
    for kind, row in rows.items():
        steps, pairs = drive.front_end.steps, drive.front_end.motions[kind]
        ends = [(true[steps[pair.first].t], true[steps[pair.second].t]) for pair in pairs]
        motions = [(pair.motion.delta, pair.motion.cov) for pair in pairs]
        judges_as_matrices_do(row, [(*one, *motion) for one, motion in zip(ends, motions, strict=True)])


def test_parts_are_within_the_whole_and_none_is_free() -> None:
    row = frame_cost(drives(SHORT))
    assert row.log == "depth-room"
    timed = drives(SHORT)[0].front_end
    ms, orb = 1e-6 * np.array(timed.frame_ns), 1e-6 * np.array(timed.orb_ns)
    assert row.frames == timed.counts["frames looked at"] == len(ms) == len(orb)
    assert (row.mean, row.orb) == pytest.approx((ms.mean(), orb.mean()))
    assert row.parts == pytest.approx([1e-6 * timed.ns[part] / len(ms) for part in PARTS])
    assert all(part > 0 for part in row.parts)
    assert sum(row.parts) < row.mean
    assert row.median <= row.p99
    assert row.ratio == pytest.approx(row.mean / row.orb)


@pytest.mark.slow
def test_loop_search_is_counted_by_the_place() -> None:
    (drive,) = drives(CLOSED)
    row, (neighbours, places) = loop_cost([drive]), pair_costs([drive])
    assert (neighbours.kind, places.kind) == ("neighbours", "loop")
    assert neighbours.pairs == drive.front_end.counts["pairs"]
    assert places.pairs == drive.front_end.search.searched
    assert places.mean * places.pairs == pytest.approx(row.mean * row.frames, rel=0.05)  # but the frames without any
    assert row.places == len(drive.front_end.search.places)
    at, bytes_held = np.array(drive.front_end.held).T
    half = len(at) // 2
    assert at[-1] == row.frames
    assert 1e3 * row.held_kb * (at[-1] - at[half]) == pytest.approx(bytes_held[-1] - bytes_held[half])
    assert bytes_held[-1] > bytes_held[half]


@pytest.mark.slow
def test_what_is_held_is_what_python_counts() -> None:
    recording, _ = record(Options(laps=0.1), np.random.default_rng(1))
    frames = [frame._replace(grey=frame.grey.copy(), depth=frame.depth.copy()) for frame in recording.frames]
    tracemalloc.start()
    try:
        front_end = Timed(recording, Settings())
        for frame in frames:
            front_end.frame(frame)
        arrays = tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)  # type: ignore[attr-defined]
        traced = tracemalloc.take_snapshot().filter_traces([arrays])
        counted = sum(trace.size for trace in traced.traces)
    finally:
        tracemalloc.stop()
    shared = recording.camera.rays.nbytes  # made once, by whoever asked for it first
    given = held(frames[-1])  # the last frame, which was there before
    assert held(front_end) - given == pytest.approx(counted, abs=shared + 0.05 * counted)
    assert held([frames[0].grey, frames[0].grey]) == held(frames[0].grey[::2]) == 640 * 480


def seen(camera: Camera, xyz: Array, descriptors: Ints) -> Features:
    pixels = camera.project(xyz)
    points = points_of(camera, pixels, xyz[:, 2], np.full(len(xyz), 1.0), Settings())
    return Features(pixels, points, descriptors.astype(np.uint8))


def test_the_references_match_and_find_a_known_motion() -> None:
    rng = np.random.default_rng(0)
    camera = Camera(640, 480, (525.0, 525.0), (320.0, 240.0), (), np.eye(4))
    xyz = np.column_stack((rng.uniform(-0.8, 0.8, (60, 2)), rng.uniform(1.5, 3.0, 60)))
    words = rng.integers(0, 256, (60, 32))
    c, s = np.cos(0.05), np.sin(0.05)
    T = np.array([[c, 0, s, 0.04], [0, 1, 0, -0.01], [-s, 0, c, 0.1], [0, 0, 0, 1]])
    order = rng.permutation(60)
    first, second = seen(camera, xyz @ T[:3, :3].T + T[:3, 3], words), seen(camera, xyz[order], words[order])
    rows = matches(first, second, 0.8)
    assert (order[rows[:, 1]] == rows[:, 0]).all()
    assert len(rows) == 60
    found = motion(first, second, 0.8, 525.0)
    assert found is not None
    np.testing.assert_allclose(found, T, atol=1e-3)
    assert motion(first, second.taken(np.arange(3)), 0.8, 525.0) is None


def test_the_command_prints_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "drive"
    recording, truth = record(Options(laps=0.1), np.random.default_rng(2))
    write_depth({folder: "tum"}, recording, truth, shots_of(recording).poses)
    monkeypatch.setattr(depth, "QUICK", DepthExtent(1, 0.1, 20))
    monkeypatch.setattr(DepthStudy, "warm_up", lambda _: None)
    table = tmp_path / "t.csv"
    arguments = ["--frontend", "--only", "depth", "--quick", "--frames", str(folder), "--csv", str(table)]
    assert main(["speed", *arguments]) == 0
    said = capsys.readouterr().out
    for words in ("depth camera's frame", "ORB", "levelling", "loop search", "held, MB", "true | stated", "neighbours"):
        assert words in said
    rows = csv_rows(table)
    assert [row["study"] for row in rows] == [
        *(["depth frame"] * 2), *(["depth pair, neighbours"] * 2), *(["depth loop search"] * 2), "depth neighbours",
    ]  # fmt: skip
    assert {row["log"] for row in rows[:2]} == {"depth-room"}
    assert float(rows[0]["ratio"]) == pytest.approx(float(rows[0]["mean_ms"]) / float(rows[0]["reference_ms"]))
    assert float(rows[0]["registration_ms"]) > 0
    assert float(rows[-1]["nees"]) > 0


def test_a_recording_that_cannot_be_a_log_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(DepthStudy, "warm_up", lambda _: None)
    words = ("speed", "--frontend", "--only", "depth", "--quick", "--frames")
    assert "found no colour and depth images, expected a recording" in refused(capsys, *words, tmp_path)
    recording, truth = record(Options(laps=0.05), np.random.default_rng(2))
    standing = replace(recording, frames=list(islice(recording.frames, 2)))
    write_depth({tmp_path / "drive": "tum"}, standing, truth, shots_of(recording).poses)
    assert "found 2 frames and 1 steps, expected a drive" in refused(capsys, *words, tmp_path / "drive")
