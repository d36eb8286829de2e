"""Landmarks and way points in every form of file, and what is refused with file and row."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from slamduel.core.errors import InputError
from slamduel.datasets.own_worlds.points import Points, read_landmarks, read_way_points

XY = np.array([[1.0, 2.0], [-3.5, 4.0], [0.0, 1e3]])
READERS = {"landmarks": read_landmarks, "way points": read_way_points}


def written(place: Path, text: str) -> Path:
    place.write_text(text, encoding="utf-8")
    return place


def refused(read: Callable[[Path], Points], place: Path) -> str:
    with pytest.raises(InputError) as caught:
        read(place)
    return str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["x,y\n1,2\n-3.5,4\n0,1e3\n", "1 2\n-3.5 4\n0 1e3", "# made by hand\n1\t2\n\n-3.5 4\n0 1000\n",
     "1,2\n-3.5,4\n0,1000\n",
     "y, x, name\r\n2,1,a\r\n4,-3.5,b\r\n1000,0,c\r\n"],
    ids=["header", "blanks", "comment", "commas", "other order"],
)  # fmt: skip
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_both_are_read_with_a_header_and_without(tmp_path: Path, text: str, read: Callable[[Path], Points]) -> None:
    found = read(written(tmp_path / "points.txt", text))
    np.testing.assert_array_equal(found.xy, XY)
    np.testing.assert_array_equal(found.ids, [0, 1, 2])


@pytest.mark.parametrize("text", ["id,x,y\n7,1,2\n5,-3.5,4\n90,0,1000\n", "7 1 2\n5 -3.5 4\n90 0 1000\n"])
def test_landmarks_have_the_ids_of_their_file_and_a_path_needs_none(tmp_path: Path, text: str) -> None:
    found = read_landmarks(written(tmp_path / "points.csv", text))
    np.testing.assert_array_equal(found.ids, [7, 5, 90])
    np.testing.assert_array_equal(found.xy, XY)
    if text.startswith("id"):
        np.testing.assert_array_equal(read_way_points(tmp_path / "points.csv").xy, XY)


def test_a_mat_file_has_both_as_the_reports_function_takes_them(tmp_path: Path) -> None:
    place = tmp_path / "room.mat"
    savemat(place, {"lm": np.vstack((XY.T, [7, 5, 90])), "wp": XY.T[:, :2]})
    landmarks, way_points = read_landmarks(place), read_way_points(place)
    np.testing.assert_array_equal(landmarks.xy, XY)
    np.testing.assert_array_equal(landmarks.ids, [7, 5, 90])
    np.testing.assert_array_equal(way_points.xy, XY[:2])
    savemat(place, {"lm": XY.T})
    np.testing.assert_array_equal(read_landmarks(place).ids, [0, 1, 2])
    assert refused(read_way_points, place) == f"{place}: found lm, expected the variable wp."


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        ("way points", "x,y\n1,2\n", ": found 1 way point, expected at least two."),
        ("way points", "x,y\n1,2\n3,4\n3,4\n",
         ", line 4: the way point 3, 4 is that before it again, expected another place."),
        ("way points", "x,y\n1,2\nnan,4\n", ", line 3: x is nan, expected a finite number."),
        ("way points", "x,y\n1,2\n3\n", ", line 3: found 1 columns, expected 2 (x,y)."),
        ("way points", "1 2\n3 four\n", ", line 2: y is 'four', expected a number."),
        ("way points", "1 2 3\n4 5 6\n", ", line 1: found 3 columns, expected 2 (x,y)."),
        ("way points", "x,y\n1,2\n3,1e12\n", ", line 3: y is 1000000000000.0, expected -1e+09 to 1e+09."),
        ("landmarks", "", ": the file is empty."),
        ("landmarks", "x,y\n", ": found no rows, expected at least one below the header."),
        ("landmarks", "id,x,y\n1,0,0\n2,3,3\n1,4,4\n", ", line 4: id 1 occurs twice, expected once."),
        ("landmarks", "id,x,y\n1,0,0\n-1,3,3\n", ", line 3: id is -1, expected 0 to 9007199254740992."),
        ("landmarks", "1.5 0 0\n", ", line 1: id is 1.5, expected a whole number up to 9007199254740992."),
        ("landmarks", "east,north\n1,2\n",
         ", line 1: found the columns east,north, expected id,x,y, or x,y among them."),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, read: str, text: str, said: str) -> None:
    place = written(tmp_path / "points.csv", text)
    assert refused(READERS[read], place) == f"{place}{said}"


@pytest.mark.parametrize(
    ("variables", "said"),
    [
        ({"lm": XY[[0, 1, 2, 1]]}, ": lm is 4 x 2, expected 2 x n or 3 x n, one point per column."),
        ({"lm": np.zeros((2, 0))}, ": lm is empty, expected at least one point."),
        ({"lm": np.array([[0, np.nan], [1, 1]])}, ", column 2 of lm: x is nan, expected -1e+09 to 1e+09."),
        ({"lm": np.array([[0, 1], [1, 1], [2, 2.5]])}, ", column 2 of lm: id is 2.5, expected a whole number up to"),
        ({"lm": np.array([[0, 1], [1, 1], [2, 2]])}, ", column 2 of lm: id 2 occurs twice, expected once."),
        ({"lm": "six tags"}, ": lm holds no real numbers, expected 2 x n of them."),
        ({"wp": XY.T}, ": found wp, expected the variable lm."),
    ],
)
def test_what_is_wrong_in_a_mat_file_is_named_with_its_column(
    tmp_path: Path, variables: dict[str, Any], said: str
) -> None:
    place = tmp_path / "room.mat"
    savemat(place, variables)
    assert refused(read_landmarks, place).startswith(f"{place}{said}")


def test_a_mat_file_that_is_none_or_of_another_version_is_refused(tmp_path: Path) -> None:
    place = tmp_path / "room.mat"
    place.write_bytes(b"x,y\n1,2\n" * 30)
    assert refused(read_landmarks, place).startswith(f"{place}: is no file of MATLAB (")
    place.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(400))
    assert refused(read_landmarks, place) == f"{place}: is a file of MATLAB 7.3, expected one written by save -v7."
    assert refused(read_landmarks, tmp_path / "none.mat").endswith("there is no such file.")
    assert refused(read_landmarks, tmp_path / "none.csv").endswith("there is no such file.")
