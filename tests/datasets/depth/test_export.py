"""One drive of a depth camera, written as every kind of recording and read back: the same frames and factors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from refusals import refused
from slamduel.core.factors import Log, Truth
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.depth.open import OpenedDepth, build, open_depth
from slamduel.datasets.recordings.write_depth import FORMATS, write_depth
from slamduel.datasets.worlds.depth_room import Drive, record, shots_of
from slamduel.frontend.depth.log import build_log
from slamduel.frontend.depth.recording import DepthFrame, DepthRecording
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.wheels.track import Track
from tiers import first_quick

Driven = tuple[DepthRecording, Truth, Array]
DRIVE = Drive(laps=0.06, boxes=2)


@pytest.fixture(scope="module")
def drive() -> Driven:
    recording, truth = record(DRIVE, np.random.default_rng(5))
    shots = shots_of(recording)
    frames = [frame if k % 2 else frame._replace(colour=_tinted(frame)) for k, frame in enumerate(shots)]
    return replace(recording, frames=frames), truth, shots.poses


def _tinted(frame: DepthFrame) -> np.ndarray:
    """Three values that differ and are the frame's grey again."""
    return np.dstack((frame.grey, frame.grey, frame.grey)).astype(np.uint8)


@pytest.fixture(scope="module")
def log(drive: Driven) -> Log:
    return build_log(drive[0], Settings())


@pytest.fixture(scope="module")
def folders(drive: Driven, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    home = tmp_path_factory.mktemp("exports")
    write_depth({home / name: name for name in FORMATS}, *drive)
    return {name: home / name for name in FORMATS}


def opened(path: Path) -> OpenedDepth:
    found = open_depth(path)
    assert found is not None
    return found


@pytest.mark.parametrize("name", first_quick(FORMATS))
def test_every_format_gives_the_same_frames_and_factors(
    name: str, drive: Driven, log: Log, folders: dict[str, Path]
) -> None:
    recording, truth, _ = drive
    found = opened(folders[name])
    frames = list(recording.frames)
    for _ in range(2):  # any number of times
        again = list(found.recording.frames)
        assert found.length == len(again) == len(frames) > 12
        for one, ours in zip(again, frames, strict=True):
            assert one.seconds == pytest.approx(ours.seconds, abs=1e-9)
            np.testing.assert_array_equal(one.grey, ours.grey)
            np.testing.assert_array_equal(one.depth, ours.depth)
            assert one.depth.dtype == np.float32
            assert (one.colour is None) == (ours.colour is None)
    assert not found.recording.left_out.total()
    assert found.recording.remarks == []
    motion, written = found.recording.motion, recording.motion
    assert isinstance(motion, Track)
    assert isinstance(written, Track)
    assert motion.noise == written.noise
    np.testing.assert_allclose(motion.poses[:, :2], written.poses[:, :2], atol=1e-12)
    np.testing.assert_allclose(wrap(motion.poses[:, 2] - written.poses[:, 2]), 0, atol=1e-12)
    made, known = build(found)
    assert len(made.ids) == len(log.ids) > 100
    assert made.name == log.name
    np.testing.assert_array_equal(made.ids, log.ids)
    np.testing.assert_array_equal(made.sighting_step, log.sighting_step)
    for column in ("t", "z", "z_cov", "delta", "delta_cov"):
        np.testing.assert_allclose(getattr(made, column), getattr(log, column), rtol=0, atol=1e-9)
    np.testing.assert_allclose(made.prior.pose, log.prior.pose, atol=1e-12)
    np.testing.assert_allclose(made.prior.cov, log.prior.cov, rtol=1e-12)
    rows = np.searchsorted(truth.t, made.t - 1e-6)
    np.testing.assert_allclose(known.t, made.t, atol=1e-12)
    np.testing.assert_allclose(known.poses[:, :2], truth.poses[rows, :2], atol=1e-9)
    np.testing.assert_allclose(wrap(known.poses[:, 2] - truth.poses[rows, 2]), 0, atol=1e-9)


def test_what_is_in_the_way_is_refused_and_nothing_is_left(drive: Driven, tmp_path: Path) -> None:
    refused("format: found 'avi', expected one of tum, frames", write_depth, {tmp_path / "a": "avi"}, *drive)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "mine").write_text("here")
    refused("b: exists and is not an empty", write_depth, {tmp_path / "c": "tum", tmp_path / "b": "frames"}, *drive)
    recording, truth, cameras = drive
    backwards = replace(recording, frames=list(recording.frames)[1::-1])
    place = {tmp_path / "d": "frames"}
    refused("frame 1 is at 0.0 s, expected later than 0.2 s", write_depth, place, backwards, truth, cameras)
    refused("found no frame, expected", write_depth, place, replace(recording, frames=[]), truth, cameras)
    assert [one.name for one in tmp_path.iterdir()] == ["b"]
