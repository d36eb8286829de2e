"""The drives of TUM's robot: fetched as published, and read with the wheels and the truth of the bag."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bags
import publishers
import toy_log
from depth_views import MOUNTING, RATE, START, image_message, info_message, mounted, stamp
from publishers import Http
from refusals import refused
from slamduel.bench.cli import main
from slamduel.bench.plan.load import load
from slamduel.datasets.hidden_ids import HIDDEN_NOTE
from slamduel.datasets.published.catalogue import PUBLISHED, place
from slamduel.datasets.published.tum_pioneer import bag_file
from slamduel.datasets.rendering.disturbances import raised
from toy_log import Printed, Serve, beside, refusal

quick = pytest.fixture(autouse=True)(toy_log.quick)
serve = pytest.fixture(toy_log.serve)

NAMES = ("tum-pioneer-360", "tum-pioneer-slam", "tum-pioneer-slam2", "tum-pioneer-slam3")
IMAGE, DEPTH, INFO = "/camera/rgb/image_color", "/camera/depth/image", "/camera/rgb/camera_info"
FRAME = "/openni_rgb_optical_frame"
INNER = raised(np.array([[0.01, -0.02, 0.1]]))[0]
"""T_kinect_camera: from the markers on the housing to the lens."""

FRAMES = 8


def pioneer_bag(folder: Path, capture: bool = True, placed: bool = False) -> bytes:
    """A bag as TUM's: odometry and motion capture on tf, registered depth of floats; the capture misses the start."""
    folder.mkdir(parents=True)
    said = [info_message(INFO, frame=FRAME)]
    fixed = [mounted("base_link", FRAME) if placed else mounted("/kinect", FRAME, INNER)]
    for k in range(-2, FRAMES + 2):
        t = START + k / RATE
        x = 0.05 * max(k, 0)
        moving = [bags.Transform("/odom", "/base_link", (1.01 * x, 0.0, 0.0))]
        if capture and k > 1:
            camera = raised(np.array([[x, 0.1, 0.0]]))[0] @ MOUNTING
            moving.append(mounted("/world", "/kinect", camera @ np.linalg.solve(INNER, np.eye(4)).astype(float)))
        said.append(bags.transforms(stamp(t), *moving, *fixed, topic="/tf"))
    for k in range(FRAMES):
        said.append(image_message(k, IMAGE, "bgr8", FRAME))
        said.append(image_message(k, DEPTH, "32FC1", FRAME, START + k / RATE + 0.008))
    return bags.write(folder, "ros1", sorted(said, key=lambda one: one.stamp)).read_bytes()


def served(monkeypatch: pytest.MonkeyPatch, name: str, server: Http) -> None:
    path = PUBLISHED[name].urls[0].partition(".de")[2]
    monkeypatch.setitem(PUBLISHED, name, replace(PUBLISHED[name], urls=(server.url.removesuffix("/log.zip") + path,)))


@pytest.mark.parametrize("name", NAMES)
def test_each_is_published_as_one_bag(name: str) -> None:
    run = name.rpartition("-")[2]
    (url,) = PUBLISHED[name].urls
    assert url == f"https://cvg.cit.tum.de/rgbd/dataset/freiburg2/rgbd_dataset_freiburg2_pioneer_{run}.bag"
    assert url.endswith(bag_file(name))
    assert PUBLISHED[name].licence == "CC BY 4.0"
    assert PUBLISHED[name].largest > 2**32


def test_a_drive_is_fetched_and_read(
    serve: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    content = pioneer_bag(tmp_path / "made")
    server = serve(publishers.sends(content))
    served(monkeypatch, "tum-pioneer-slam", server)
    assert main(["fetch", "tum-pioneer-slam"]) == 0
    assert server.paths == ["/rgbd/dataset/freiburg2/rgbd_dataset_freiburg2_pioneer_slam.bag"]
    bag = place("tum-pioneer-slam") / bag_file("tum-pioneer-slam")
    assert bag.read_bytes() == content
    printed = capsys.readouterr().out
    assert hashlib.sha256(content).hexdigest() in printed
    assert "licence: CC BY 4.0" in printed
    log, truth = load("tum-pioneer-slam[up=0.75,tilt=0.3490658503988659,ahead=0.12]")
    assert log.name == "tum-pioneer-slam"
    assert log.notes["licence"] == "CC BY 4.0"
    assert len(log) >= 2
    # The wheels count 1 % too much; nothing in the pictures is found again.
    way = log.delta[1:, 0].sum()
    assert way == pytest.approx(1.01 * 0.05 * RATE * (log.t[-1] - log.t[0]), rel=1e-6)
    assert (truth.t >= START + 0.2).all()
    assert 0 < len(truth.t) < len(log)  # it covers a part
    expected = np.column_stack((0.05 * RATE * (truth.t - START), np.full(len(truth.t), 0.1), np.zeros(len(truth.t))))
    np.testing.assert_allclose(truth.poses, expected, atol=1e-6)


def test_without_a_place_of_the_camera_the_options_are_named(tmp_path: Path) -> None:
    pioneer_bag(tmp_path / "made")
    refused("expected options up, tilt and ahead", load, f"tum-pioneer-360[path={tmp_path}/made/drive.bag]")


def test_ids_are_hidden_on_demand_and_all_else_is_the_same(tmp_path: Path) -> None:
    """Nothing in these pictures is found again."""
    pioneer_bag(tmp_path / "made")
    given = f"up=0.75,tilt=0.35,path={tmp_path / 'made' / 'drive.bag'}"
    plain, hidden = (load(f"tum-pioneer-360[{given}{more}]") for more in ("", ",ids=hidden"))
    np.testing.assert_array_equal(plain.log.delta, hidden.log.delta)
    assert HIDDEN_NOTE not in plain.log.notes
    assert hidden.log.notes[HIDDEN_NOTE] == "0 of 0"


def test_a_bag_without_the_truth_is_refused(tmp_path: Path) -> None:
    pioneer_bag(tmp_path / "made", capture=False, placed=True)
    refused("tf has no transform from 'world' that", load, f"tum-pioneer-360[path={tmp_path}/made/drive.bag]")


def test_a_page_in_place_of_the_bag_is_not_taken(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    server = serve(publishers.sends(b"<!doctype html>We have moved."))
    served(monkeypatch, "tum-pioneer-slam2", server)
    text = refusal(capsys, "tum-pioneer-slam2")
    assert "a web page, not the published file." in text
    assert "download rgbd_dataset_freiburg2_pioneer_slam2.bag, of several gigabytes, then: bench fetch" in text
    assert beside() == set()
    refused(r"tum-pioneer-slam2 is not on this machine: bench fetch tum-pioneer-slam2", load, "tum-pioneer-slam2")


def test_a_file_is_copied_without_being_read_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bag is larger than memory: nothing asks for all of its bytes."""
    file = tmp_path / bag_file("tum-pioneer-slam3")
    file.write_bytes(b"#ROSBAG V2.0\n" + bytes(10_000))

    def never(path: Path) -> bytes:
        raise AssertionError(f"{path} was read whole")

    monkeypatch.setattr(Path, "read_bytes", never)
    assert main(["fetch", "tum-pioneer-slam3", "--from", str(file), "--quiet"]) == 0
    assert main(["fetch", "tum-pioneer-slam3", "--check", "--quiet"]) == 0
    assert (place("tum-pioneer-slam3") / file.name).stat().st_size == file.stat().st_size
