"""What is told of recordings in which nothing is found: planted faults are named, healthy ones left alone."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from recorded import at_hand
from slamduel.datasets.rendering.render import Renderer
from slamduel.datasets.rendering.room import furnish
from slamduel.datasets.rendering.surfaces import paint
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.camera.sharpness import blur
from slamduel.frontend.markers.aruco import Detector, Image, Sighting
from slamduel.frontend.markers.decoding import FAMILIES, decode
from slamduel.frontend.markers.diagnosis import BLURRED, MOST, diagnose, plausible_length
from slamduel.frontend.markers.markers import Markers, find
from tiers import first_quick

CAMERA = Camera(640, 480, (576.0, 576.0), (320.0, 240.0), (), mounting(0.12, 0.0, 0.75, 0.35))
OWN = Markers("4X4_50", 0.16)
CUSTOM = "custom[count=30,size=4,seed=0]"


@cache
def frames(dictionary: str = "4X4_50", lens: float = 0.6, markers: int = 24) -> tuple[Image, ...]:
    """Five views of a room, half of its markers on the floor."""
    rng = np.random.default_rng(3)
    room = furnish(6.0, 5.0, 2.5, 0.16, 24, rng)
    room = replace(room, markers=room.markers[:markers])
    made = Renderer(room, CAMERA, dictionary, paint(room, np.random.default_rng(1)), blur=lens)
    views: list[Image] = []
    for x, y, heading in zip(*rng.uniform(-1.3, 1.3, (2, 5)), np.linspace(-3, 1.8, 5), strict=True):
        c, s = np.cos(heading), np.sin(heading)
        robot = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])
        views.append(made.frame(robot @ CAMERA.mounting, rng))
    return tuple(views)


def told(images: tuple[Image, ...] | list[Image], markers: Markers = OWN) -> str:
    """The only sentence."""
    (sentence,) = diagnose(images, markers, CAMERA)
    return sentence


@pytest.mark.parametrize("lens", first_quick([0.6, 0.3, 1.0]))
def test_a_healthy_recording_is_left_alone(lens: float) -> None:
    assert diagnose(frames(lens=lens), OWN, CAMERA) == []
    for name in ("4X4_100", "DICT_4X4_50", "4x4_1000", "custom[base=4X4_50,count=60]"):
        assert diagnose(frames(lens=lens), Markers(name, 0.16), CAMERA) == []


def test_markers_of_ones_own_and_no_frames_are_left_alone() -> None:
    assert diagnose(frames(CUSTOM), Markers(CUSTOM, 0.16), CAMERA) == diagnose([], OWN, CAMERA) == []


@pytest.mark.parametrize(("drawn", "named"), [("6X6_250", "6X6_50"), ("APRILTAG_36H11", "APRILTAG_36H11")])
def test_another_dictionary_is_named(drawn: str, named: str) -> None:
    """The ids in the room are below 24: the smallest of the family has them all."""
    said = told(frames(drawn))
    assert said.startswith(f"{named} reads ")
    assert said.endswith("; the recording says 4X4_50")


def sheet(dictionary: str, *names: int) -> Image:
    """A sheet of paper with markers in a row."""
    paper = np.full((480, 640), 200, np.uint8)
    for place, index in enumerate(names):
        drawn = find(dictionary).generateImageMarker(index, 90)
        paper[150:240, 60 + 140 * place : 150 + 140 * place] = drawn
    return paper


@pytest.mark.parametrize("drawn", FAMILIES)
def test_every_dictionary_is_named(drawn: str) -> None:
    last = len(find(drawn).bytesList) - 1
    said = told([sheet(drawn, 1, 2, last)] * 2, Markers(CUSTOM, 0.16))
    assert said == f"{drawn} reads 3 markers in 2 of 2 frames (ids 1, 2, {last}); the recording says {CUSTOM}"


def test_one_marker_is_too_little_for_a_large_dictionary_of_few_bits() -> None:
    """A square with bits at random is a marker of 4X4_1000 one time in sixteen, of 4X4_50 in 330."""
    unsure = told([sheet("4X4_1000", 999)] * 6, Markers("6X6_250", 0.16))
    assert "no known dictionary reads" in unsure
    sure = told([sheet("4X4_50", 49)] * 6, Markers("6X6_250", 0.16))
    assert sure == "4X4_50 reads 1 marker in 6 of 6 frames (id 49); the recording says 6X6_250"


def test_the_smallest_dictionary_that_has_all_ids() -> None:
    """Ids beyond 99, in the same family as the recording's own."""
    said = told([sheet("4X4_250", 3, 99, 100, 249)] * 2)
    assert said == "4X4_250 reads 4 markers in 2 of 2 frames (ids 3, 99, 100, 249); the recording says 4X4_50"


def test_a_mirrored_image_and_a_negative() -> None:
    mirrored = [np.ascontiguousarray(image[:, ::-1]) for image in frames()]
    said = told(mirrored)
    assert said.startswith("the image is mirrored: once flipped left to right, 4X4_50 reads ")
    assert "the recording says" not in said
    both = told(mirrored, Markers("6X6_250", 0.16))
    assert both.startswith("the image is mirrored: once flipped left to right, 4X4_50 reads ")
    assert both.endswith("; the recording says 6X6_250")
    inverted = told([255 - image for image in frames("6X6_50")], Markers("6X6_250", 0.16))
    assert inverted.startswith("the markers are white on black: once inverted, 6X6_250 reads ")


FAULTS: dict[str, Callable[[Image], object]] = {
    "too dark: 99 % of a frame's pixels are below": lambda image: image * 0.04,
    "over-exposed: [0-9]+% of a frame's pixels are saturated": lambda image: image * 6.0,
    "lacks contrast: nearly all grey levels are between": lambda image: image * 0.04 + 110,
    "blurred, by the lens or by motion": lambda image: cv2.GaussianBlur(image, (0, 0), 4.0),
    "blurred, by the lens or by (?=motion)": lambda image: cv2.blur(image, (17, 1)),
}


@pytest.mark.parametrize(("sentence", "spoil"), FAULTS.items())
@pytest.mark.parametrize("colour", [False, True])
def test_what_is_wrong_with_the_image(sentence: str, spoil: Callable[[Image], object], colour: bool) -> None:
    spoilt = [np.clip(np.asarray(spoil(image), float), 0, 255).astype(np.uint8) for image in frames()]
    if colour:
        spoilt = [np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8) for image in spoilt]
    assert re.search(sentence, told(spoilt))


def test_an_unknown_dictionary() -> None:
    said = told(frames(CUSTOM))
    assert "frames hold black squares with a pattern inside that no known dictionary reads" in said


def test_a_room_without_markers() -> None:
    assert told(frames(markers=0)) == "nothing in 5 frames looks like a marker: a black square, white all around it"


def test_markers_too_small_for_the_camera() -> None:
    sentences = diagnose(frames(markers=0), Markers("4X4_50", 0.02), CAMERA)
    assert [s.split(" and")[0] for s in sentences] == ["a marker of 0.02 m is 15 px wide at 0.77 m from this camera"]


def test_only_so_many_frames_are_looked_at() -> None:
    said = told(frames()[:1] * 1000, Markers("6X6_250", 0.16))
    assert f"in {MOST} of {MOST} frames" in said


def test_clutter_is_not_taken_for_markers() -> None:
    """Squares with bits at random, of every size: now and then one of them is a word of some dictionary."""
    rng = np.random.default_rng(7)
    believed = words = 0
    for _ in range(8):
        images: list[Image] = []
        for _ in range(2):
            image = np.full((480, 640), 150, np.uint8)
            for place in range(12):
                cells = int(rng.integers(6, 10))
                patch = 255 * (rng.random((cells, cells)) < 0.5).astype(np.uint8)
                patch[[0, -1]] = patch[:, [0, -1]] = 0
                patch = np.asarray(cv2.resize(np.pad(patch, 1, constant_values=255), (100, 100), interpolation=0))
                y, x = 30 + 150 * (place // 4), 30 + 150 * (place % 4)
                image[y : y + 100, x : x + 100] = patch
            images.append(image)
        words += sum(len(cv2.aruco.ArucoDetector(find("4X4_1000")).detectMarkers(image)[0]) for image in images)
        believed += len(decode(images, "5X5_50", find("5X5_50")).readings)
    assert words >= 3
    assert believed == 0


def test_blur_is_measured() -> None:
    """Against the blur of the rendering lens, to a fifth; the threshold is between what is read and what is not."""
    for lens in (0.6, 1.0, 1.5):
        assert blur(frames(lens=lens)) == pytest.approx(lens, rel=0.2, abs=0.1)
    for lens, fine in ((1.0, True), (4.0, False)):
        found = sum(len(Detector(OWN, CAMERA).detect(image)[0]) for image in frames(lens=lens))
        measured = blur(frames(lens=lens))
        assert measured is not None
        assert (found > 5) == fine == (measured < BLURRED)
    assert blur([np.full((480, 640), 90, np.uint8)]) is blur([np.zeros((8, 8), np.uint8)]) is None


def sighting(distance: float, index: int = 0) -> Sighting:
    pose = np.eye(4)
    pose[2, 3] = distance
    return Sighting(index, np.zeros((4, 2)), np.eye(8), pose, pose[:3, 3], np.eye(6), 0.1, 0.5)


@pytest.mark.parametrize(
    ("side", "distance", "sentence"),
    [
        (0.16, 0.3, None),
        (0.16, 8.0, None),
        (160.0, 1600.0, "the markers would be 1600 m away; side = 160 reads like millimetres, 0.16 m"),
        (16.0, 160.0, "the markers would be 160 m away; side = 16 reads like centimetres, 0.16 m"),
        (5.0, 70.0, "the markers would be 70 m away; side = 5 reads like centimetres, 0.05 m"),
        (1.6, 40.0, "the markers would be 40 m away; is side = 1.6 their length in metres?"),
        (0.00016, 0.0014, "the markers would be 1.4 mm away; is side = 0.00016 their length in metres?"),
    ],
)
def test_a_length_in_other_units(side: float, distance: float, sentence: str | None) -> None:
    seen = [sighting(distance * factor) for factor in (0.9, 1.0, 1.05)]
    assert plausible_length(seen, Markers("4X4_50", side)) == sentence
    assert plausible_length([], Markers("4X4_50", side)) is None


def test_a_length_in_other_units_in_rendered_frames() -> None:
    for side, expected in ((0.16, None), (160.0, "millimetres")):
        markers = Markers("4X4_50", side)
        seen = [s for image in frames() for s in Detector(markers, CAMERA).detect(image)[0]]
        said = plausible_length(seen, markers)
        assert (said is None) if expected is None else (said is not None and f"reads like {expected}, 0.16 m" in said)


def photograph(name: str) -> Image:
    image = cv2.imread(str(at_hand(f"aruco/{name}")))
    return np.asarray(image, np.uint8)


def test_a_real_photograph() -> None:
    image = photograph("singlemarkersoriginal.jpg")
    expected = "6X6_250 reads 6 markers in 1 of 1 frame (ids 23, 40, 62, 98, 124, ...); the recording says 4X4_50"
    assert told([image]) == expected
    assert diagnose([image], Markers("6X6_250", 0.16), CAMERA) == []
    assert told([image[:, ::-1].copy()]).startswith("the image is mirrored: once flipped left to right, 6X6_250")
    assert told([255 - image]).startswith("the markers are white on black")


@pytest.mark.parametrize("name", ["choriginal.jpg", "img_00.jpg", "chocclusion_original.jpg", "gboriginal.png"])
def test_other_real_photographs(name: str) -> None:
    said = told([photograph(name)])
    known = "no known dictionary reads" if name == "gboriginal.png" else "6X6_50 reads"
    assert known in said
