"""Marker dictionaries by name, drawn and from files, and what is refused of sizes and ids."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from recorded import at_hand
from refusals import refused
from slamduel.frontend.markers.markers import Markers, find, predefined, write


def bits(name: str, index: int, folder: Path | None = None) -> str:
    found = find(name, folder)
    drawn = np.asarray(found.generateImageMarker(index, found.markerSize + 2))[1:-1, 1:-1]
    return "".join("1" if bit else "0" for bit in drawn.ravel())


def test_every_predefined_dictionary_is_found() -> None:
    names = predefined()
    assert {"4X4_50", "6X6_250", "ARUCO_ORIGINAL", "APRILTAG_36H11", "ARUCO_MIP_36H12"} <= set(names)
    for name, number in names.items():
        expected = cv2.aruco.getPredefinedDictionary(number)
        np.testing.assert_array_equal(find(name).bytesList, expected.bytesList)
    np.testing.assert_array_equal(find("DICT_apriltag_36h11").bytesList, find("APRILTAG_36H11").bytesList)


def test_a_drawn_dictionary_never_changes() -> None:
    """Markers are printed once: these are the words that OpenCV 5.0 draws."""
    assert len(find("custom[count=30,size=4,seed=0]").bytesList) == 30
    assert [bits("custom[count=30,size=4,seed=0]", index) for index in (0, 1, 29)] == DRAWN
    assert bits("custom[count=30,size=4,seed=1]", 0) != DRAWN[0]
    assert bits("custom[ size=4, count=30 ]", 0) == DRAWN[0]


DRAWN = ["0101001100101100", "1010111110001111", "1010001101010001"]


def test_a_dictionary_is_continued() -> None:
    base, more = find("4X4_50"), find("custom[base=4X4_50,count=80,seed=0]")
    assert len(more.bytesList) == 80
    np.testing.assert_array_equal(more.bytesList[:50], base.bytesList)
    for index in range(50, 80):  # a new word is at least two bits from every other, however it is turned
        drawn = np.asarray(more.generateImageMarker(index, 6))[1:-1, 1:-1] // 255
        for other in set(range(80)) - {index}:
            assert more.getDistanceToId(drawn.astype(np.uint8), other) >= 2


@pytest.mark.parametrize("ending", [".yml", ".yaml", ".xml", ".json"])
def test_written_and_read_again(tmp_path: Path, ending: str) -> None:
    drawn = find("custom[count=12,size=5,seed=3]")
    write(tmp_path / f"mine{ending}", drawn)
    for read in (find(f"mine{ending}", tmp_path), find(str(tmp_path / f"mine{ending}"))):
        np.testing.assert_array_equal(read.bytesList, drawn.bytesList)
        assert (read.markerSize, read.maxCorrectionBits) == (5, drawn.maxCorrectionBits)
    assert sorted(os.listdir(tmp_path)) == [f"mine{ending}"]
    np.testing.assert_array_equal(Markers(f"mine{ending}", 0.1, {}, tmp_path).opencv.bytesList, drawn.bytesList)


def test_a_file_of_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "mine.yml", find("4X4_50"))
    monkeypatch.chdir(tmp_path)
    assert len(find("mine.yml").bytesList) == 50


def test_an_ending_opencv_does_not_know_is_refused(tmp_path: Path) -> None:
    refused(r"mine\.txt: found the ending '\.txt', expected one of \.yml", write, tmp_path / "mine.txt", find("4X4_50"))


def test_opencvs_own_example() -> None:
    found = find("tutorial_dict.yml", at_hand("aruco"))
    assert (len(found.bytesList), found.markerSize) == (35, 6)
    assert bits("tutorial_dict.yml", 0, at_hand("aruco")) == "101011111011111001001001101100000000"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("4X4_500", r"no '4X4_500'; the nearest is 4X4_50; write a custom one as custom\["),
        ("tags", "expected one of 4X4_100, .*, ARUCO_ORIGINAL; write a custom one"),
        ("custom[count=30]", "expected count and either size or base"),
        ("custom[size=4]", "expected count and either size or base"),
        ("custom[count=30,size=4,base=4X4_50]", "expected count and either size or base"),
        ("custom[count=30,size=4,sede=0]", "found 'sede=0'"),
        ("custom[count=30,count=4]", "found 'count=4'"),
        ("custom[count=many,size=4]", "count: found 'many', expected a whole number from 1 to 1000"),
        ("custom[count=5,size=99]", "size: found '99', expected a whole number from 3 to 8"),
        ("custom[count=5,size=4,seed=-1]", "seed: found '-1'"),
        ("custom[base=4X4_50,count=50]", "count: found 50, expected more than the base's"),
        ("custom[base=4X4_5,count=50]", "the nearest is 4X4_50"),
        ("custom[count=600,size=3]", "could not generate 600 markers of 3x3 bits that differ"),
        ("nowhere.yml", "nowhere.yml: there is no such file"),
    ],
)
def test_a_name_that_means_nothing(name: str, sentence: str) -> None:
    refused(sentence, find, name)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "not YAML, XML or JSON"),
        ("some words", "not YAML, XML or JSON"),
        ('{"nmarkers": 3', "not YAML, XML or JSON"),
        ('%YAML:1.0\nmarkersize: 2\nmarker_0: "0110"\n', "nmarkers: found no whole number"),
        ("%YAML:1.0\nnmarkers: 1\nmarkersize: two\n", "markersize: found no whole number"),
        ('%YAML:1.0\nnmarkers: 2\nmarkersize: 2\nmarker_0: "0110"\n', "marker_1: found '', expected 4 characters"),
        ('%YAML:1.0\nnmarkers: 1\nmarkersize: 2\nmarker_0: "011011101"\n', "marker_0: found '011011101', expected 4"),
        ('%YAML:1.0\nnmarkers: 1\nmarkersize: 2\nmarker_0: "01a0"\n', "marker_0: found '01a0'"),
    ],
)
def test_a_file_that_is_no_dictionary(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "odd.yml").write_text(text)
    refused(rf"odd\.yml: {sentence}", find, "odd.yml", tmp_path)


def test_good_markers_are_not_refused() -> None:
    markers = Markers("4X4_50", 0.16, {7: 0.2, 49: 9.9})
    markers.check("robot.toml: [markers]")
    assert (markers.side_of(7), markers.side_of(8)) == (0.2, 0.16)


@pytest.mark.parametrize(
    ("markers", "sentence"),
    [
        (Markers("4X4_50", 160), r"side: found 160, expected metres .* \(0.16 if this is in millimetres\)"),
        (Markers("4X4_50", 15), r"side: found 15, expected metres .* \(0.15 if this is in centimetres\)"),
        (Markers("4X4_50", 0), "side: found 0, expected metres from 0.0001 to 10$"),
        (Markers("4X4_50", -0.1), "side: found -0.1"),
        (Markers("4X4_50", float("nan")), "side: found nan"),
        (Markers("4X4_50", float("inf")), "side: found inf"),
        (Markers("4X4_50", 0.1, {3: 0.0}), "sides: 3: found 0"),
        (Markers("4X4_50", 0.1, {50: 0.1}), "sides: found id 50, expected one of 4X4_50, 0 to 49"),
        (Markers("4X4_50", 0.1, {-1: 0.1}), "sides: found id -1"),
    ],
)
def test_sides_and_ids_no_marker_has(markers: Markers, sentence: str) -> None:
    refused(rf"robot\.toml: \[markers\]: {sentence}", markers.check, "robot.toml: [markers]")
