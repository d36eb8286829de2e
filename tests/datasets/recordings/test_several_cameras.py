"""Two cameras on one robot in one recording: one log of the sightings of both, at their own times."""

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command import run
from driven import rmse
from driven import run as driven
from refusals import refused
from slamduel.bench.commands import detect as command_detect
from slamduel.bench.detect.markers import MarkerFindings
from slamduel.core.errors import InputError
from slamduel.core.factors import Log
from slamduel.core.se2 import compose
from slamduel.datasets.depth.robot import read_depth_robot
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import read_robot, write_robot
from slamduel.datasets.recordings.write import write
from slamduel.datasets.worlds.aruco_room import AROUND, Options, aruco_room, record
from slamduel.frontend.markers.pipeline import Recording, build_log
from tiers import first_quick

OPTIONS = Options(cameras=2, seconds=2.0, frame_rate=2.0)


@pytest.fixture(scope="module")
def drive() -> Recording:
    recording, _ = record(OPTIONS, np.random.default_rng(3))
    return replace(recording, frames=list(recording.frames))


@pytest.fixture(scope="module")
def alone() -> Log:
    return aruco_room(replace(OPTIONS, cameras=1), np.random.default_rng(3)).log


@pytest.fixture(scope="module")
def folders(drive: Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    home = tmp_path_factory.mktemp("two")
    write({home / name: name for name in ("frames", "video", "ros1", "mcap")}, drive, None)
    return {one.name: one for one in home.iterdir()}


@pytest.fixture
def folder(folders: dict[str, Path], tmp_path: Path) -> Path:
    """A copy of the folder of frames."""
    return Path(shutil.copytree(folders["frames"], tmp_path / "drive"))


def edited(folder: Path, *pairs: tuple[str, str]) -> Path:
    """The folder, with its robot.toml changed."""
    words = (folder / "robot.toml").read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in words
        words = words.replace(old, new)
    (folder / "robot.toml").write_text(words, encoding="utf-8")
    return folder


def assert_in_it(one: Log, other: Log, steps: Sequence[int]) -> None:
    """The sightings of `one` are the first ones of these `steps` of the other log, one for each of its own."""
    for mine, theirs in zip(one, (other[k] for k in steps), strict=True):
        count = len(mine.sightings.ids)
        np.testing.assert_array_equal(theirs.sightings.ids[:count], mine.sightings.ids)
        np.testing.assert_allclose(theirs.sightings.z[:count], mine.sightings.z, rtol=0, atol=1e-9)
        np.testing.assert_allclose(theirs.sightings.cov[:count], mine.sightings.cov, rtol=0, atol=1e-9)


def test_what_the_first_camera_tells_is_as_if_it_were_alone(drive: Recording, alone: Log) -> None:
    log = build_log(drive)
    assert len(alone.ids) > 10
    assert len(log.ids) > 1.5 * len(alone.ids)
    np.testing.assert_array_equal(log.t, alone.t)
    np.testing.assert_allclose(log.delta[1:], alone.delta[1:], rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.delta_cov[1:], alone.delta_cov[1:], rtol=0, atol=1e-9)
    assert_in_it(alone, log, range(len(alone)))
    assert list(log.notes["camera"]) == ["front", "back"]
    assert log.notes["counts"]["frames"] == 2 * len(alone)


@pytest.mark.parametrize("kind", first_quick(("frames", "mcap", "video", "ros1"), 2))
def test_every_kind_of_recording_gives_the_same_factors(kind: str, drive: Recording, folders: dict[str, Path]) -> None:
    opened, log = open_recording(folders[kind]), build_log(drive)
    assert opened.length == 2 * len(log)
    found = build(opened).log
    np.testing.assert_array_equal(found.ids, log.ids)
    np.testing.assert_array_equal(found.sighting_step, log.sighting_step)
    for column in ("t", "z", "z_cov", "delta", "delta_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(log, column), rtol=0, atol=1e-9)
    assert not found.remarks


def test_cameras_at_times_of_their_own_have_steps_of_their_own(folder: Path, alone: Log) -> None:
    robot = read_robot(folder / "robot.toml")
    late = replace(robot.views["back"], time_offset=0.1, exposure=0.04)
    write_robot(folder / "robot.toml", replace(robot, views={**robot.views, "back": late}))
    log = build(open_recording(folder)).log
    assert log.notes["time_offset"] == {"front": 0.0, "back": 0.1}
    np.testing.assert_allclose(log.t[:4], [0.0, 0.12, 0.5, 0.62], atol=1e-9)  # after the middle of the exposure
    assert_in_it(alone, log, range(0, len(log), 2))
    for k in range(1, len(alone)):
        between = compose(log.delta[2 * k - 1], log.delta[2 * k])
        np.testing.assert_allclose(between, alone.delta[k], rtol=0, atol=1e-9)


def test_rounding_makes_no_times_of_their_own(folder: Path, drive: Recording) -> None:
    robot = read_robot(folder / "robot.toml")
    views = {name: replace(view, exposure=0.02, time_offset=0.1) for name, view in robot.views.items()}
    views["back"] = replace(views["back"], exposure=0.06, time_offset=0.08 + 1e-8)
    write_robot(folder / "robot.toml", replace(robot, views=views))
    log = build(open_recording(folder)).log
    assert len(log) == len(build_log(drive)) - (log.notes["counts"].get("frames without encoder readings", 0) > 0)
    np.testing.assert_array_equal(log.t, log.t[0] + np.arange(len(log)) / 2)


def test_both_cameras_make_the_path_more_accurate() -> None:
    """In one frame a second of 58 degrees there is mostly one marker; a second camera behind adds as many."""
    errors = []
    for count in (1, 2):
        made = aruco_room(Options(cameras=count, seconds=12.0, frame_rate=1.0), np.random.default_rng(1))
        errors.append(rmse(driven("ekf", made.log)[1], made.truth.poses))
    assert errors[1] < errors[0] / 3


def test_names_and_mountings_of_a_rendered_robots_cameras() -> None:
    recording, _ = record(replace(OPTIONS, cameras=4), np.random.default_rng(0))
    assert list(recording.detectors) == list(AROUND)
    ahead = {name: one.camera.mounting[:3, 2] for name, one in recording.detectors.items()}
    np.testing.assert_allclose(ahead["back"][:2], -ahead["front"][:2], atol=1e-12)
    assert ahead["left"][1] > 0.9
    assert ahead["right"][1] < -0.9


@pytest.mark.slow
def test_markers_that_two_cameras_see_at_once_are_one_sighting_as_sure_as_stated() -> None:
    """Those on the edge of two fisheye lenses, 90 degrees apart: the mean is surer than either, and rightly so."""
    options = Options(cameras=3, camera="fisheye", seconds=8.0, frame_rate=1.0)
    recording, truth = record(options, np.random.default_rng(0))
    seen = list[tuple[float, list[int], np.ndarray]]()
    log = build_log(recording, lambda one: seen.append((one.frame.t, one.near.ids.tolist(), one.near.cov)))
    joined = 0
    squares = list[float]()
    for k, step in enumerate(log):
        frames = [(ids, cov) for t, ids, cov in seen if t == step.t]
        assert sorted({name for ids, _ in frames for name in ids}) == sorted(step.sightings.ids.tolist())
        for name, z, cov in zip(*step.sightings, strict=True):
            own = [covs[ids.index(name)] for ids, covs in frames if name in ids]
            if len(own) < 2:
                continue
            joined += len(own) - 1
            assert all(np.trace(cov) < np.trace(one) for one in own)
            x, y, heading = truth.poses[k]
            away = truth.map.xy[truth.map.ids == name][0] - (x, y)
            error = z - (np.hypot(*away), np.arctan2(away[1], away[0]) - heading)
            error[1] = np.angle(np.exp(1j * error[1]))
            squares.append(float(error @ np.linalg.solve(cov, error)) / 2)
    assert joined > 10
    assert 0.5 < np.mean(squares) < 2.0
    (counted,) = (n for name, n in log.notes["counts"].items() if "another camera" in name)
    assert counted == joined
    assert log.notes["counts"]["sightings"] == len(log.ids)


def test_what_robot_toml_says_of_cameras_reads_back(folder: Path) -> None:
    robot = read_robot(folder / "robot.toml")
    assert list(robot.views) == ["front", "back"]
    assert [view.frames.source for view in robot.views.values()] == ["front", "back"]
    assert [view.camera.name for view in robot.views.values()] == ["front", "back"]
    assert (folder / "calibration-front.yaml").is_file()
    edited(folder, ("exposure = 0.0\n", "exposure = 10.0\n"))
    refused(r"line 6: camera\.front\.exposure: found 10.* seconds", read_robot, folder / "robot.toml")


CAMERAS = """[camera.left]
source = "left"
[camera.right]
topic = "/right"
{}
[markers]
dictionary = "4X4_50"
side = 0.1
"""


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('source = "left"\n', "", r"line 1: camera\.left has no 'source', expected the folder, video, tags.csv or bag"),
        ("[camera.left]", "[camera]\nexposure = 0.01\n[camera.left]", r"camera\.left: is one of several .* exposure"),
        ("[camera.right]", '[camera."ri/ght"]', r"line 3: camera\.'?\"?ri/ght.* found a camera called 'ri/ght', expec"),
        ('source = "left"', 'sorce = "left"', r"line 2: camera\.left\.sorce: there is no such key; did you mean"),
        ("{}", '[frames]\nsource = "left"', r"line 6: frames\.source: is of an only camera, expected \[camera\.left\]"),
        ("{}", '[topics]\nimage = "/left"', r"line 6: topics\.image: is of an only camera, expected \[camera\.left\]"),
        ("{}", "[camera.right.mountign]", r"camera\.right\.mountign: there is no such key; did you mean 'mounting'"),
    ],
)
def test_what_cameras_do_not_say_is_refused(before: str, after: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(CAMERAS.replace(before, after).replace("{}", ""), encoding="utf-8")
    refused(words, read_robot, tmp_path / "robot.toml")


def test_a_misspelt_mounting_is_no_camera(tmp_path: Path) -> None:
    words = '[camera]\nexposure = 0.01\nmountign = {xyz = [0, 0, 1]}\n[markers]\ndictionary = "4X4_50"\nside = 0.1\n'
    (tmp_path / "robot.toml").write_text(words, encoding="utf-8")
    refused(r"line 3: camera\.mountign: there is no such key; did you mean 'mounting'\?",
            read_robot, tmp_path / "robot.toml")  # fmt: skip


def test_frames_twice_or_nowhere_are_refused(folder: Path) -> None:
    both = r"\[camera\.front\] and \[camera\.back\] in robot\.toml both have .*frames, expected one for each"
    refused(both, open_recording, edited(folder, ('source = "back"', 'source = "front/frames"')))
    edited(folder, ('source = "front/frames"', 'source = "else"'))
    refused(r"there is no .*else, which is the \[camera\.back\] source in robot\.toml", open_recording, folder)
    edited(folder, ('source = "else"', 'topic = "/back"'))
    refused(r"drive: .*found none, expected one recording.*\[camera\.back\] source", open_recording, folder)
    edited(folder, ('topic = "/back"', 'source = "back"\ntopic = "/back"'))
    refused(r"back/frames: is no bag, expected \[camera\.back\] in robot\.toml without a topic", open_recording, folder)
    robot = read_robot(folder / "robot.toml")
    refused(r"camera:0: is one camera, expected robot\.toml without \[camera\.front\], \[camera\.back\]\.",
            open_recording, Path("camera:0"), robot)  # fmt: skip


def test_a_calibration_that_is_missing_is_that_of_a_camera(folder: Path) -> None:
    edited(folder, ('calibration = "calibration-back.yaml"\n', ""))
    refused(r"drive: camera back: the camera's calibration is unknown, .*: \[camera\.back\] calibration = ",
            open_recording, folder)  # fmt: skip


def test_topics_of_a_bag(folders: dict[str, Path], drive: Recording, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["ros1"], tmp_path / "drive"))
    words = (folder / "robot.toml").read_text(encoding="utf-8")
    edited(folder, ('topic = "/back/image_raw"', 'topic = "/front/image_raw"'))
    refused(r"both have topic /front/image_raw of .*drive\.bag, expected one for each", open_recording, folder)
    (folder / "robot.toml").write_text(words.replace("/back/image_raw", "/encoder"), encoding="utf-8")
    refused(
        r"\[camera\.back\] topic: found /encoder .*, expected messages of sensor_msgs/Image", open_recording, folder
    )
    kept = words.replace('calibration = "calibration-back.yaml"\n', "").replace(
        'camera_info = "/back/camera_info"\n', ""
    )
    (folder / "robot.toml").write_text(kept, encoding="utf-8")
    found, log = build(open_recording(folder)).log, build_log(drive)  # the camera_info beside the images tells it
    np.testing.assert_allclose(found.z, log.z, rtol=0, atol=1e-9)
    edited(folder, ('topic = "/front/image_raw"', 'source = "drive.bag"'))
    refused(r"has .*/front/image_raw .*, expected \[camera\.front\] topic to name the one", open_recording, folder)


def test_a_camera_out_of_time_is_named(folder: Path) -> None:
    times = (folder / "back" / "frames.csv").read_text(encoding="utf-8").replace(",", ",1000")
    (folder / "back" / "frames.csv").write_text(times.replace("frame,1000t", "frame,t"), encoding="utf-8")
    with pytest.raises(InputError, match=r"drive: camera back: no frame is within .*; \[camera\.back\] time_offset in"):
        build(open_recording(folder))


@pytest.mark.usefixtures("no_figures")
def test_all_that_bench_detect_writes_tells_the_cameras_apart(
    folder: Path, capsys: pytest.CaptureFixture[str], drive: Recording
) -> None:
    out, poses = folder.parent / "log", folder.parent / "poses.csv"
    given = ("--out", str(out), "--poses", str(poses), "--preview", str(folder.parent / "film.mp4"))
    assert run(command_detect, str(folder), *given) == 0
    said = capsys.readouterr().out
    log, count = build_log(drive), len(build_log(drive))
    assert f"in {2 * count} frames" in said
    assert f" sightings in {count} frames of front and " in said
    assert "poses-front.csv" in said
    names = sorted(one.name for one in folder.parent.iterdir())
    assert names == ["drive", "film-back.mp4", "film-front.mp4", "log", "poses-back.csv", "poses-front.csv"]
    page = (out / "detection.html").read_text(encoding="utf-8")
    assert re.search("front 640 . 480 px . back 640 . 480 px", page)
    assert "s, back: " in page
    assert run(command_detect, str(folder), *given[:2], "--json") == 0
    cameras = json.loads(capsys.readouterr().out)["cameras"]
    assert [one["frames"] for one in cameras.values()] == [count, count]
    assert sum(one["sightings"] for one in cameras.values()) == len(log.ids)


@pytest.mark.usefixtures("no_figures")
def test_poses_of_each_camera_are_tags_of_it(folder: Path, drive: Recording) -> None:
    arguments = ("--out", str(folder.parent / "log"), "--poses", str(folder / "poses.csv"), "--quiet")
    assert run(command_detect, str(folder), *arguments) == 0
    edited(folder, *((f'source = "{name}"', f'source = "poses-{name}.csv"') for name in ("front", "back")))
    log, found = build_log(drive), build(open_recording(folder)).log
    np.testing.assert_array_equal(found.ids, log.ids)
    np.testing.assert_allclose(found.z, log.z, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.z_cov, log.z_cov, rtol=1e-9, atol=1e-15)
    assert run(command_detect, str(folder), *arguments[:2], "--poses", str(folder / "poses.jrl"), "--quiet") == 0
    factors = json.loads((folder / "poses.jrl").read_text(encoding="utf-8"))["measurements"]["a"]
    for step, row in enumerate(factors):
        for one in row["measurements"]:
            x, y, _ = one["measurement"]["translation"]
            mine = log[step].sightings if one["key2"] & 0xFFFFFF in log[step].sightings.ids else None
            if mine is not None:
                z = mine.z[mine.ids == one["key2"] & 0xFFFFFF][0]
                np.testing.assert_allclose([np.hypot(x, y), np.arctan2(y, x)], z, atol=1e-9)


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MarkerFindings, "figures", lambda _: [])


def test_a_depth_camera_is_one(tmp_path: Path) -> None:
    words = "[camera.left]\n[camera.right]\n[depth]\nunits = 1000\n"
    (tmp_path / "robot.toml").write_text(words, encoding="utf-8")
    refused(r"line 1: camera\.left: is one of several cameras, expected the one whose images have depth",
            read_depth_robot, tmp_path / "robot.toml")  # fmt: skip
