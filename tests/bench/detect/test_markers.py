"""`bench detect`: a log that runs as it is, whole or not at all, and what is told of what was found."""

import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from command import run as run_command
from slamduel.bench.commands import detect as command_detect
from slamduel.bench.detect import markers as detecting
from slamduel.bench.detect import page
from slamduel.bench.detect.folder import Request
from slamduel.bench.detect.kept_frames import MOST
from slamduel.bench.detect.markers import MarkerFindings, detect
from slamduel.bench.detect.preview import Preview
from slamduel.bench.detect.sightings import Detection, in_log, markers, per_frame, true_errors
from slamduel.core.errors import InputError
from slamduel.core.factors import Truth
from slamduel.datasets.formats import log_folder
from slamduel.datasets.worlds.aruco_room import Options, record
from slamduel.frontend.markers.aruco import Rejections
from slamduel.frontend.markers.markers import Markers
from slamduel.frontend.markers.noise import PropagatedNoise, ProportionalNoise
from slamduel.frontend.markers.pipeline import Frame, Recording, build_log, see
from slamduel.frontend.wheels.track import Track
from small_recording import CAMERA, FLOOR, K, picture, sighting, small_recording


def run(out: Path, recording: Recording, truth: Truth | None, **request: Any) -> MarkerFindings:
    return detect(recording, truth, Request("drive", out, **request), lambda _: None)


def small(seed: int = 0, **changes: Any) -> tuple[Recording, Truth]:
    return small_recording(np.random.default_rng(seed), **changes)


def blank(recording: Recording) -> Recording:
    """The same without a marker in it."""
    told: Any = recording.detector
    return replace(recording, detector=replace(told, told=tuple(([], Rejections()) for _ in told.told)))


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports are drawn in tests of their own."""
    monkeypatch.setattr(page, "rendered", lambda *_: "")
    monkeypatch.setattr(MarkerFindings, "figures", lambda _: [])


@pytest.mark.usefixtures("no_figures")
def test_truth_is_taken_to_the_frames_times(tmp_path: Path) -> None:
    recording, truth = small()
    between = (truth.t[1:] + truth.t[:-1]) / 2
    middle = Truth(between, (truth.poses[1:] + truth.poses[:-1]) / 2, truth.map, None, "truth")
    run(tmp_path / "log", recording, middle)
    read = log_folder.read(tmp_path / "log").truth
    np.testing.assert_array_equal(read.t, truth.t[1:-1])
    straight = np.hypot(*(read.poses - truth.poses[1:-1])[:, :2].T)
    assert straight.max() < 1.5 * 0.06**2 / 2  # the sagitta of an arc of 1.5 m radius, a frame's turn long


def test_errors_are_measured_minus_true() -> None:
    recording, truth = small(3)
    detection = Detection()
    build_log(recording, lambda seen: detection.observe(seen, CAMERA.mounting))
    shuffled = truth._replace(map=truth.map._replace(ids=truth.map.ids[::-1], xy=truth.map.xy[::-1]), t=truth.t[5:])
    shuffled = shuffled._replace(poses=truth.poses[5:])
    s = detection.sightings()
    found = true_errors(s, truth.t, shuffled)
    np.testing.assert_array_equal(found.known, s.frame >= 5)
    expected = []
    for k in np.flatnonzero(found.known):
        x, y, heading = truth.poses[s.frame[k]]
        way = complex(*(truth.map.xy[s.ids[k]] - (x, y))) * np.exp(-1j * heading)
        expected.append((s.z[k, 0] - abs(way), np.angle(np.exp(1j * (s.z[k, 1] - np.angle(way))))))
    np.testing.assert_allclose(found.errors, expected, atol=1e-12)
    sd = np.hypot(K * s.z[found.known], FLOOR)
    assert 0.8 < np.mean((found.errors / sd) ** 2) < 1.2
    none = true_errors(s, truth.t, truth._replace(map=None))
    assert not none.known.any()


@pytest.mark.usefixtures("no_figures")
def test_findings_are_what_is_in_the_log(tmp_path: Path) -> None:
    recording, truth = small()
    f = run(tmp_path / "log", recording, truth)
    log = log_folder.read(tmp_path / "log").log
    kept = in_log(f.sightings)
    np.testing.assert_array_equal(kept.ids, log.ids)
    np.testing.assert_array_equal(kept.z, log.z)
    assert per_frame(kept, 60).tolist() == np.diff(log.sighting_first).tolist()
    rows = {one.id: one for one in markers(kept, f.log.t)}
    assert list(rows) == np.unique(log.ids).tolist()
    for name, row in rows.items():
        mine = log.ids == name
        times = np.repeat(log.t, np.diff(log.sighting_first))[mine]
        assert row.sightings == mine.sum()
        assert (row.first, row.last) == (times[0], times[-1])
        assert (row.nearest, row.farthest) == (log.z[mine, 0].min(), log.z[mine, 0].max())
        assert row.error == pytest.approx(0.1 + 0.01 * name)
        assert row.ambiguous == (name == 3)
    far = int((~f.sightings.kept).sum())
    assert far > 0
    assert dict(f.left_out) == {"same id twice in a frame": 4, "sightings beyond 3 m": far}
    assert f.headline()[0].startswith(f"{len(log.ids)} sightings of {len(rows)} markers in 60 frames")


@pytest.mark.usefixtures("no_figures")
def test_without_truth_nothing_is_told_of_errors(tmp_path: Path) -> None:
    f = run(tmp_path / "log", small()[0], None)
    assert log_folder.read(tmp_path / "log").truth is None
    assert "truth" not in " ".join(f.headline())
    assert f.as_json("log")["by_range"] == []


@pytest.mark.usefixtures("no_figures")
def test_an_earlier_detection_is_replaced_and_only_by_a_whole_one(tmp_path: Path) -> None:
    out = tmp_path / "log"
    recording, truth = small(1)
    run(out, recording, truth, calibrate_noise=True)
    assert (out / "noise.toml").is_file()
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def broken() -> Iterator[Frame]:
        yield Frame(0.0, picture(0))
        raise InputError("frame 1 cannot be read")

    with pytest.raises(InputError, match="frame 1 cannot be read"):
        run(out, replace(recording, frames=broken()), truth)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    run(out, *small(2))
    assert not (out / "noise.toml").exists()
    assert (out / "sightings.csv").read_bytes() != before["sightings.csv"]
    assert list(tmp_path.iterdir()) == [out]


def test_a_recording_without_a_marker_is_a_log_and_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[int] = []

    def advise(images: list[Any], *_: object) -> list[str]:
        looked.append(len(images))
        return ["The frames are <dark>."]

    monkeypatch.setattr(detecting, "diagnose", advise)
    recording, truth = small()
    f = run(tmp_path / "log", blank(recording), truth)
    assert f.advice() == ["The frames are <dark>."]
    assert 6 <= looked[0] <= MOST
    assert len(log_folder.read(tmp_path / "log").log.ids) == 0
    assert f.headline() == ["No marker that can be used was found in 60 frames."]
    assert "The frames are &lt;dark&gt;." in (tmp_path / "log" / "detection.html").read_text()
    assert run(tmp_path / "other", *small()).advice() == []


@pytest.mark.usefixtures("no_figures")
def test_motions_that_the_truth_contradicts_are_noticed(tmp_path: Path) -> None:
    def mirrored() -> Recording:
        recording = small()[0]
        motion = recording.motion
        assert isinstance(motion, Track)
        return replace(recording, motion=replace(motion, poses=motion.poses * [1.0, -1.0, -1.0]))

    recording, truth = small()
    assert run(tmp_path / "right", recording, truth).advice() == []
    (said,) = run(tmp_path / "mirrored", mirrored(), truth).advice()
    assert re.match(r"Against the truth, the errors of the motions are typically [0-9.]+ times what is stated: ", said)
    assert run(tmp_path / "unknown", mirrored(), None).advice() == []


def test_a_side_in_other_units_is_noticed(tmp_path: Path) -> None:
    recording, _ = small()
    told: Any = recording.detector
    far = [([sighting(1, 90.0, 0.1)], Rejections()) for _ in told.told]
    wrong = replace(told, told=tuple(far), markers=Markers("4X4_50", 16.0))
    f = run(tmp_path / "log", replace(recording, detector=wrong), None)
    assert len(f.advice()) == 1
    assert f.advice()[0].startswith("The markers would be 90 m away; side = 16 ")
    assert f.advice()[0].endswith(".")


@pytest.mark.parametrize("frames", [[], [Frame(0.0, None), Frame(1.0, None)], [Frame(-9.0, picture(0))]])
def test_without_a_usable_frame_nothing_is_written(tmp_path: Path, frames: list[Frame]) -> None:
    with pytest.raises(InputError, match="found no frame"):
        run(tmp_path / "log", replace(small()[0], frames=frames), None, preview=Preview(tmp_path / "x.mp4"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("no_figures")
def test_bad_frames_are_counted(tmp_path: Path) -> None:
    recording, truth = small()
    frames = [frame._replace(image=None) if k in (3, 7) else frame for k, frame in enumerate(recording.frames)]
    f = run(tmp_path / "log", replace(recording, frames=frames), truth)
    assert len(f.log) == 58
    assert f.left_out[0] == ("frames that could not be decoded", 2)
    assert np.abs(f.true.errors[:, 0]).max() < 6 * np.hypot(0.02 * 5, 0.01)  # each with its own frame's truth


@pytest.mark.usefixtures("no_figures")
def test_what_is_left_out_is_counted_and_named_as_it_is(tmp_path: Path) -> None:
    counts = {"frames": 9, "sightings": 3, "frames without odometry": 1, "sightings beyond 3 m": 2, "too dark": 1}
    f = run(tmp_path / "log", small()[0], None)
    said = replace(f, log=replace(f.log, notes={"counts": counts})).refused()
    assert said == "Left out: 1 frame without odometry, 2 sightings beyond 3 m and 1 marker (too dark)."


@pytest.mark.parametrize("lost", ["truth", "map", "poses"])
def test_noise_is_not_calibrated_without_truth(tmp_path: Path, lost: str) -> None:
    recording, truth = small()
    less = {
        "truth": None,
        "map": truth._replace(map=None),
        "poses": truth._replace(t=np.zeros(0), poses=np.zeros((0, 3))),
    }[lost]
    with pytest.raises(InputError, match=r"drive: has no truth for --calibrate-noise, expected .*truth\.tum"):
        run(tmp_path / "log", replace(recording, frames=_untouched()), less, calibrate_noise=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("seed", range(2))
def test_calibrated_noise_is_the_noise_there_is(tmp_path: Path, seed: int) -> None:
    recording, truth = small_recording(np.random.default_rng(seed), 500, max_range=6.0)
    f = run(tmp_path / "log", recording, truth, calibrate_noise=True)
    c = f.calibration
    for fit, k, floor in zip((c.range, c.bearing), K, FLOOR, strict=True):
        # Held against 4.5 standard errors, and the bend by fitting to readings and not to true ranges: k^2.
        assert abs(fit.k - k) < 4.5 * fit.k_error + k**2
        assert abs(fit.floor - floor) < 4.5 * fit.floor_error + k**2
    bins = f.calibration.bins
    n = sum(one.sightings for one in bins)
    before, after, _ = np.average([one.nees for one in bins], axis=0, weights=[one.sightings for one in bins])
    assert abs(after - 1) < 6 / np.sqrt(n)
    assert before < 0.5  # the default is a cautious one
    assert c.likelier == "proportional"
    written = tomllib.loads((tmp_path / "log" / "noise.toml").read_text())["noise"]
    assert written.pop("model") == "proportional"
    noise = ProportionalNoise(**written)
    assert noise.k_range == pytest.approx(c.range.k, rel=1e-3)
    assert noise.floor_bearing == pytest.approx(c.bearing.floor, rel=1e-3)
    told = f.as_json("log")
    assert told["noise"]["standard_errors"]["scale"] == c.corners.scale_error
    json.dumps(told)


@pytest.mark.usefixtures("no_figures")
def test_the_sway_of_a_rocking_body_is_calibrated(tmp_path: Path) -> None:
    recording, truth = record(Options(seconds=40.0, frame_rate=1.5, sway=0.03), np.random.default_rng(3))
    recording = replace(recording, noise=ProportionalNoise())
    c = run(tmp_path / "log", recording, truth, calibrate_noise=True).calibration
    # Sightings of a frame have their rocking in common: the standard error takes them as independent.
    assert abs(c.corners.sway - 0.03) < 6 * c.corners.sway_error
    assert c.corners.sway_error < 0.004
    assert c.likelier == "propagated"
    written = tomllib.loads((tmp_path / "log" / "noise.toml").read_text())["noise"]
    assert written.pop("model") == "propagated"
    assert PropagatedNoise(**written).sway == pytest.approx(c.corners.sway, rel=1e-3)


def test_the_command_says_what_it_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, truth = small()
    given: list[Any] = []

    def open_recording(*words: Any, wheels: bool) -> SimpleNamespace:
        assert wheels
        given.append(words)
        others = {"inertial": None, "world": None}
        return SimpleNamespace(recording=small()[0], truth=truth, length=60, start_given=True, **others)

    monkeypatch.setattr(command_detect, "open_recording", open_recording)
    out = tmp_path / "a b"
    assert run_command(command_detect, "[drive]", "--out", out) == 0
    told = capsys.readouterr().out
    assert given == [(Path("[drive]"), None, None)]
    assert "markers in 60 frames" in told
    assert "Left out: " in told
    assert "4 markers (same id twice in a frame)" in told
    assert run_command(command_detect, "x", "--out", out, "--calibrate-noise") == 0
    assert "k_range = " in capsys.readouterr().out
    assert run_command(command_detect, "x", "--out", out, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["frames"] == 60
    assert found["sightings"] == sum(one["sightings"] for one in found["markers"])
    assert recording.name == found["name"]


def test_a_frame_seen_alone_is_seen_as_in_the_log() -> None:
    recording, _ = small()
    frame = next(iter(recording.frames))
    log = build_log(small()[0])
    seen = see(recording, frame)
    np.testing.assert_array_equal(seen.z[seen.kept], log[0].sightings.z)


def _untouched() -> Iterator[Frame]:
    raise AssertionError("frames were looked at")
    yield
