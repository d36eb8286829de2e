"""`bench detect` of a depth camera: clouds beside the log, what is told of the matches, and a film."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import depth_drives
from command import refused
from slamduel.bench.cli import main
from slamduel.bench.detect.depth import DepthFindings, Levels, detect
from slamduel.bench.detect.depth_frames import CONTRADICTED, KEPT, annotated
from slamduel.bench.detect.folder import Request
from slamduel.bench.detect.preview import Preview
from slamduel.core.factors import Log, Truth
from slamduel.datasets.depth.open import OpenedDepth, open_depth
from slamduel.datasets.formats import log_folder
from slamduel.datasets.recordings.write_depth import FORMATS, write_depth
from slamduel.datasets.worlds.depth_room import Drive, record, shots_of
from slamduel.frontend.depth.front_end import FrameFindings, FrontEnd
from slamduel.frontend.depth.log import build_log, looked_at
from slamduel.frontend.depth.pairs import Pairs
from slamduel.frontend.depth.recording import DepthRecording
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.maps.cloud import NOTHING
from slamduel.frontend.maps.spool import Spool
from tiers import first_quick

TINT = np.array([1.0, 0.5, 0.25])
"""Of blue, green and red: the rendered frames are grey."""


@pytest.fixture(scope="module")
def drive() -> tuple[DepthRecording, Truth, Any]:
    """A coloured drive of some steps."""
    recording, truth = record(Drive(laps=0.12, boxes=2), np.random.default_rng(5))
    shots = shots_of(recording)
    frames = [one._replace(colour=(one.grey[:, :, None] * TINT).astype(np.uint8)) for one in shots]
    return replace(recording, frames=frames), truth, shots.poses


@pytest.fixture(scope="module")
def folders(drive: tuple[DepthRecording, Truth, Any], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    home = tmp_path_factory.mktemp("depth")
    write_depth({home / name: name for name in FORMATS}, *drive)
    return {name: home / name for name in FORMATS}


def run(path: Path, out: Path, **request: Any) -> DepthFindings:
    opened = open_depth(path)
    assert opened is not None
    return detect(opened, Request("drive", out, **request), lambda _: None)


@pytest.mark.parametrize("kind", first_quick(FORMATS))
def test_every_kind_of_recording_becomes_the_same_log(
    kind: str, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["detect", str(folders[kind]), "--out", str(tmp_path / "log"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    log = log_folder.read(tmp_path / "log").log
    assert found["steps"] == len(log) == len(log.clouds.first) - 1 > 6
    assert found["frames"] > 15
    assert found["keyframes"] == found["steps"]
    assert found["landmarks"] == len(np.unique(log.ids)) > 20
    assert found["pairs_registered"] > 0.8 * found["pairs"] > 8
    assert found["steps_without_floor"] == 0
    assert found["points"] == len(log.clouds.points) > 1000 * len(log)
    assert found["wheels"] is True
    assert found["left_out"] == {}
    assert found["advice"] == []
    blue, green, red = log.clouds.colours.astype(float).mean(axis=0)[::-1]
    np.testing.assert_allclose([green / blue, red / blue], TINT[1:], atol=0.02)
    np.testing.assert_array_equal(log.clouds.at.step, np.arange(len(log)))


def test_the_command_refuses_what_it_cannot_do(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tum, odd = folders["tum"], folders["tum"] / "odd.toml"
    odd.write_text((tum / "robot.toml").read_text().replace("registered = true", 'registered = "yes"'))
    for words, said in (
        (("--calibrate-noise",), "is of a depth camera, which has no markers to fit"),
        (("--preview", "x.txt"), "--preview x.txt: "),
        (("--seconds", "0.01"), "1 frames and 1 steps, expected a drive"),
        (("--scan", "/scan"), "has no [laser], expected it where a topic of scans"),
        (("--robot", odd), "depth.registered: found 'yes'"),
    ):
        assert said in refused(capsys, "detect", tum, *words, "--out", tmp_path / "log", "--quiet")
    assert not (tmp_path / "log").exists()


def test_the_map_shows_the_path_and_levels_the_rocking(folders: dict[str, Path], tmp_path: Path) -> None:
    found = run(folders["frames"], tmp_path / "log")
    picture = cv2.imread(str(tmp_path / "log" / "map.png"))
    assert max(picture.shape) > 400
    assert (picture == (178, 114, 0)).all(axis=2).sum() > 50  # the path's blue
    tilts = found.levels.tilts
    assert tilts.shape == (len(found.log), 3)
    assert 0.005 < tilts[:, :2].std() < 0.05  # rocking of 0.02 rad
    assert np.abs(tilts[:, 2]).max() < 0.01


def made_up(counts: dict[str, int], **others: Any) -> DepthFindings:
    """Findings of four steps with these counts."""
    n, none = 4, np.zeros(0, np.int64)
    recording, _ = record(Drive(laps=0.1), np.random.default_rng(0))
    first = {"frames": 9, "frames looked at": n, "features": 400 * n, "pairs": 5, "pairs registered": 5}
    notes = {
        "counts": first | counts,
        "turned_down": others.get("turned_down", {}),
        "loops": {
            "searched": others.get("searched", 0),
            "places": 2,
            "found": 0,
            "turned_down": {"too few matches": 3},
        },
        "settings": {"level": True, "landmarks": others.get("landmarks", False)},
    }
    motion = np.tile([0.15, 0.0, 0.0], (n, 1))
    log = Log.from_arrays(
        "<cart>", recording.prior, np.arange(4.0), motion, np.tile(1e-4 * np.eye(3), (n, 1, 1)), none, none,
        np.zeros((0, 2)), np.zeros((0, 2, 2)), loop_step=np.array([3]), loop_to=np.array([0]), loop_delta=motion[:1],
        loop_cov=np.tile(1e-4 * np.eye(3), (1, 1, 1)), notes={"depth": notes},
    )  # fmt: skip
    recording.left_out.update(others.get("left_out", {}))
    levels = Levels(others.get("tilts", np.zeros((n, 3))), others.get("found", np.ones(n, bool)))
    return DepthFindings(log, None, 3.0, recording, np.zeros((n, 3)), levels, np.array([[3, 0]]))


def test_what_was_matched_is_told_in_numbers() -> None:
    assert made_up({}).headline() == [
        "9 frames of 640x480 pixels in 3.00 s, with wheels: 4 steps over 0.450 m, 1 loop closure.",
        "5 of 5 pairs of keyframes were registered.",
        "The floor levels every step.",
    ]
    assert made_up({}, landmarks=True).headline()[0].endswith("4 steps over 0.450 m, 0 sightings of 0 landmarks.")
    assert made_up({}).advice() == []
    found = made_up(
        {"frames without depth": 3, "frames without odometry": 2, "frames without a floor": 1, "pairs registered": 3},
        turned_down={"it contradicts the wheels": 1, "too few matches": 1}, searched=4,
        left_out={"frames without depth": 3}, found=np.array([True, True, False, True]),
    )  # fmt: skip
    assert found.headline()[1:] == [
        "3 of 5 pairs of keyframes were registered.",
        "The floor levels 3 steps; 1 (25 %) show no floor and are taken as the mounting states.",
        "Earlier places were compared 4 times and recognised 1 time.",
    ]
    assert found.left_out == [("frames without depth", 3), ("frames without odometry", 2)]
    assert found.refused() == (
        "Turned down: 1 (it contradicts the wheels) and 1 (too few matches). "
        "Left out: 3 frames without depth and 2 frames without odometry."
    )
    json.dumps(replace_clouds(found).as_json("log"))


def replace_clouds(found: DepthFindings) -> DepthFindings:
    """With clouds of no points."""
    spool = Spool()
    for _ in range(len(found.log)):
        spool.add(NOTHING)
    return replace(found, log=replace(found.log, clouds=spool.clouds(found.recording.camera)))


@pytest.mark.parametrize(("scale", "told"), [(1.0, 0), (10.0, 1), (1000.0, 1), (1e-3, 1)])
def test_depth_in_another_unit_is_a_remark(drive: tuple[DepthRecording, Truth, Any], scale: float, told: int) -> None:
    recording, _, _ = drive
    frames = [one._replace(depth=one.depth * np.float32(scale)) for one in recording.in_order()]
    log = build_log(replace(recording, frames=frames), Settings())
    median = log.notes["depth"]["median"]
    assert 0.5 * scale < median < 5.0 * scale
    found = [one for one in log.remarks if f"the median depth is {median:.3g} m, and only depths from 0.4 to" in one]
    assert len(found) == told
    assert told or not log.remarks


def test_what_looks_wrong_is_said() -> None:
    (said,) = made_up({}, found=np.array([False, False, False, True])).advice()
    assert said.startswith("75 % of the steps show no floor: perhaps [camera] mounting is wrong")
    (said,) = made_up({}, tilts=np.tile([0.1, 0.0, 0.07], (4, 1))).advice()
    assert "pitched by 5.7 degrees, rolled by 0.0 and 7 cm above where the mounting has it" in said
    (said,) = made_up({"features": 40}).advice()
    assert said.startswith("A keyframe has 10 features with depth, expected hundreds")
    (said,) = made_up({"pairs registered": 1}, turned_down={"it contradicts the wheels": 4}).advice()
    assert said.startswith("80 % of the pairs contradict the wheels: perhaps the images' clock (time_offset)")
    (said,) = made_up({"pairs registered": 1}, turned_down={"too few matches": 4}).advice()
    assert said == "80 % of the pairs of keyframes were turned down."


# --- the film ---------------------------------------------------------------------------------------------------------


def test_the_film_has_every_frame(folders: dict[str, Path], tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    found = run(folders["frames"], tmp_path / "log", preview=Preview(film))
    video, frames = cv2.VideoCapture(str(film)), 0
    while video.read()[0]:
        frames += 1
    assert frames == found.counts["frames"]
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(5, rel=0.02)
    video.release()


def pixels_of(picture: Any, colour: tuple[int, int, int]) -> int:
    """The pixels of a colour right of the legend and above the words."""
    return int((picture[:330, 240:] == colour).all(axis=2).sum())


def test_features_are_drawn_by_what_became_of_them(drive: tuple[DepthRecording, Truth, Any]) -> None:
    pictures = list[Any]()
    recording = drive[0]

    def observe(front_end: FrontEnd) -> None:
        assert front_end.seen is not None
        pictures.append((front_end.seen, annotated(front_end.seen, recording.camera)))

    looked_at(recording, Settings(), observe)
    for seen, picture in pictures:
        assert picture.shape == (480, 640, 3)
        if seen.keyframe is None:
            assert not seen.stepped
            assert not pixels_of(picture, KEPT)
        elif seen.trials and seen.trials[0].pair is not None and len(seen.trials[0].pair.rows) > 150:
            assert seen.stepped
            assert pixels_of(picture, KEPT) > 500
    assert sum(seen.stepped for seen, _ in pictures) > 6
    assert len(pictures) == len(list(recording.frames))


def test_a_feature_has_the_colour_of_what_became_of_it() -> None:
    recording, shown, _ = depth_drives.drive(1, Drive(), 4)
    one, two = (depth_drives.keyframe(k, shown[k], recording, Settings()) for k in (0, 2))
    trial = Pairs(recording.camera, Settings()).register(one, two, 12, None)
    rows = trial.pair.rows
    refused = trial._replace(pair=None, reason="it contradicts the wheels", contradicted=rows)
    half = trial._replace(pair=trial.pair._replace(rows=rows[::2]), contradicted=rows[1::2])
    drawn = {}
    for name, trials in {"kept": [trial], "refused": [refused], "half": [half], "alone": []}.items():
        picture = annotated(FrameFindings(shown[2], two, trials, [], stepped=True), recording.camera)
        drawn[name] = [pixels_of(picture, colour) for colour in (KEPT, CONTRADICTED)]
    assert drawn["kept"][0] > 500
    assert drawn["kept"][1] == drawn["alone"][0] == drawn["alone"][1] == 0
    assert drawn["refused"][1] > 300
    assert drawn["refused"][0] == 0
    assert min(drawn["half"]) > 100


@pytest.mark.slow
def test_a_box_that_crosses_the_view_is_drawn_as_contradicted() -> None:
    recording, shown, _ = depth_drives.drive(1, Drive(mover=0.35), 45)
    most = 0

    def observe(front_end: FrontEnd) -> None:
        nonlocal most
        assert front_end.seen is not None
        most = max(most, pixels_of(annotated(front_end.seen, recording.camera), CONTRADICTED))

    looked_at(replace(recording, frames=shown), Settings(step=0.02, turn=0.02), observe)
    assert most > 100


def test_a_drive_without_wheels_has_clouds_at_its_steps(
    drive: tuple[DepthRecording, Truth, Any], tmp_path: Path
) -> None:
    recording, truth, _ = drive
    settings = Settings(landmarks=False, loops=True, odometry="visual")
    opened = OpenedDepth(replace(recording, motion=None), settings, truth, None)
    found = detect(opened, Request("drive", tmp_path / "log"), lambda _: None)
    assert "without wheels" in found.headline()[0]
    assert len(found.clouds.at.step) == len(found.log) > 6
    assert found.counts["frames looked at"] == found.counts["frames"]
    assert "frame to frame" in (tmp_path / "log" / "detection.html").read_text()
