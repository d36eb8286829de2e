"""The original ArUco EKF system's settings/default.yaml as a robot: what became what, and what is missing or odd."""

from pathlib import Path

import numpy as np
import pytest

import bags
from refusals import refused
from slamduel.datasets.recordings.any_recording import Options as RecordingOptions
from slamduel.datasets.recordings.any_recording import make
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.settings import read_described, read_settings
from slamduel.frontend.markers.aruco import Image
from slamduel.frontend.markers.markers import find
from slamduel.frontend.markers.noise import ProportionalNoise
from slamduel.frontend.wheels.encoder import Encoder

SETTINGS = """\
covariance:
    k: 0.01
    k_r: 0.05
    k_phi: 0.06

topic:
    image: /camera/image
    encoder: /cart/encoder

camera:
    fx: 150.5
    fy: 149.5
    cx: 79.5
    cy: 59.5

    k1: 0.041
    k2: -0.047
    p1: -0.0032
    p2: -0.0039
    k3: 0.011

odom:
    kl: 1.1e-03
    kr: 1.0e-03
    b: 0.7

extrinsic:
    Trc: [0.0, 0.258819, 0.965926, 0.18, -1.0, 0.0, 0.0, -0.1, 0.0, -0.965926, 0.258819, 0.0]

aruco:
    n_markers: 30
    marker_size: 4
    marker_length: 0.14
"""
CUSTOM = "custom[count=30,size=4,seed=0]"
MS = 10**6


def settings_in(folder: Path, text: str = SETTINGS) -> Path:
    (folder / "settings").mkdir(parents=True)
    (folder / "settings" / "default.yaml").write_text(text)
    return folder / "settings" / "default.yaml"


def test_every_number_becomes_what_the_program_takes_it_for(tmp_path: Path) -> None:
    robot = read_settings(settings_in(tmp_path / "cart"))
    assert robot.name == "cart"
    assert robot.encoder == Encoder(1.1e-3, 1.0e-3, 0.7, 0.01, "proportional", None, "midpoint")
    assert robot.noise == ProportionalNoise(k_range=0.05, k_bearing=0.06)
    assert (robot.markers.dictionary, robot.markers.side) == (CUSTOM, 0.14)
    assert (robot.max_range, robot.max_distance) == (np.inf, 3.0)
    assert (robot.topics.image, robot.topics.encoder) == ("/camera/image", "/cart/encoder")
    assert robot.lens is not None
    camera = robot.lens(160, 120)
    assert (camera.focal, camera.centre) == ((150.5, 149.5), (79.5, 59.5))
    assert camera.distortion == (0.041, -0.047, -0.0032, -0.0039, 0.011)
    np.testing.assert_allclose(camera.mounting[:3, 3], [0.18, -0.1, 0.0])
    np.testing.assert_allclose(camera.mounting[0], [0, 0.258819, 0.965926, 0.18], atol=1e-6)
    for words in (
        "kl, kr, b and k became [encoder] left = 0.0011, right = 0.001, base = 0.7, k = 0.01",
        "at 0.18, -0.1, 0",
    ):
        assert words in robot.assumed[""]


def picture() -> Image:
    """Marker 7 of the program's dictionary, 0.42 m ahead of the camera."""
    image = np.full((120, 160), 200, np.uint8)
    image[35:85, 55:105] = 255
    image[35:85, 55:105][1:49, 1:49] = np.asarray(find(CUSTOM).generateImageMarker(7, 48), np.uint8)
    return image


def test_a_bag_beside_the_settings_is_a_recording_of_that_robot(tmp_path: Path) -> None:
    said = [bags.image(100 * k * MS, picture(), topic="/camera/image") for k in range(1, 6)]
    said += [bags.counts(50 * k * MS, *(two for n in (10 * k, 11 * k) for two in (n - 1, n + 1)), topic="/cart/encoder")
             for k in range(1, 13)]  # fmt: skip
    said += [bags.image(100 * MS, np.zeros((4, 4), np.uint8), topic="/other")]
    file = settings_in(tmp_path)
    path = bags.write(tmp_path, "ros1", sorted(said, key=lambda one: one.stamp))
    log = build(open_recording(path)).log
    expected = Encoder(1.1e-3, 1.0e-3, 0.7, 0.01).odometry(np.array([[10.0, 11.0], [10.0, 11.0]]), np.ones(2))
    np.testing.assert_allclose(log.delta[1:], np.tile(expected.delta, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(log.delta_cov[1], expected.cov, atol=1e-15)
    assert log.ids.tolist() == [7] * 5
    assert sum("the original system's settings" in one for one in log.remarks) == 1
    named = make(RecordingOptions(path=str(path), robot=str(file)), np.random.default_rng(0)).log
    np.testing.assert_array_equal(named.z, log.z)
    np.testing.assert_allclose(np.diag(log.z_cov[0]), np.array([0.05, 0.06]) ** 2 * log.z[0] ** 2 + [4e-4, 1e-4])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("odom:", "odo:", r"default\.yaml: found no odom: among covariance, topic, .*, expected covariance, topic"),
        ("    kl: 1.1e-03\n", "", r"default\.yaml: odom: found no kl, expected a number"),
        (
            "kl: 1.1e-03",
            "kl: 900",
            r"odom: kl: found 900, expected metres per .* \(0\.00111 if this is in counts",
        ),
        ("kl: 1.1e-03", "kl: 0", "odom: kl: found 0, expected metres per count, a number other than 0"),
        ("b: 0.7", "b: 700", r"odom: b: found 700, expected metres from .* \(0\.7 if this is in millimetres\)"),
        ("k_r: 0.05", "k_r: 5", r"covariance: k_r: found 5, expected a share of 1 .* \(0\.05 if this is in percent\)"),
        ("k: 0.01", "k: x", "covariance: k: found 'x', expected a number"),
        ("0.0]", "]", "extrinsic: Trc: found .*, expected twelve numbers, three rows of four"),
        ("-1.0, 0.0, 0.0, -0.1", "1.0, 0.0, 0.0, -0.1", "extrinsic: Trc: found a mirrored rotation"),
        (
            "0.965926, 0.18",
            "0.965926, 180",
            r"extrinsic: Trc\[3\]: found 180, expected metres .* \(0\.18 if this is in mil",
        ),
        ("n_markers: 30", "n_markers: 30.5", r"aruco: n_markers: found 30\.5, expected a whole number from 1 to"),
        ("marker_size: 4", "marker_size: 14", "aruco: marker_size: found 14, expected a whole number from 3 to 8"),
        ("marker_length: 0.14", "marker_length: 140", r"aruco: marker_length: found 140, .* \(0\.14 if this is in mil"),
        ("    fx: 150.5\n", "", r"camera: found no fx, expected a number"),
        ("image: /camera/image", "image: 3", r"topic: image: found '3', expected a topic's name"),
    ],
)
def test_what_is_missing_or_of_no_robot_is_a_sentence(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SETTINGS
    refused(message, read_described, settings_in(tmp_path, SETTINGS.replace(old, new, 1)))


def test_a_lens_of_images_of_another_size_is_refused(tmp_path: Path) -> None:
    settings_in(tmp_path)
    said = [bags.image(MS, np.zeros((40, 60), np.uint8), topic="/camera/image")]
    path = bags.write(tmp_path, "ros1", [*said, bags.counts(MS, 1, 1, 1, 1, topic="/cart/encoder")])
    refused(r"found the centre 79\.5, 59\.5, expected px within the image's 60x40 px", open_recording, path)
