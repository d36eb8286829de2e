from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from evo.tools import file_interface

from refusals import refusal, refused, refused_at
from slamduel.core.truth.tum import read_tum, write_tum

GOOD = "# t x y z qx qy qz qw\n0.5 1 2 0 0 0 0 1\n1.5 1 2 0 0 0 1 0\n"


def test_paths_read_back_bit_for_bit(tmp_path: Path):
    """Headings at random, tiny, near the ends and the quarters of their range, and these themselves."""
    rng = np.random.default_rng(4)
    ends = np.array([np.pi, -np.pi, np.pi / 2, 0.0])[:, None] * (1 - 10.0 ** rng.uniform(-15.5, 0, (4, 5000)))
    tiny = rng.choice([-1.0, 1.0], 5000) * 10.0 ** rng.uniform(-300, 0, 5000)
    own = [0.0, -0.0, np.pi, np.nextafter(np.pi, 0), np.nextafter(-np.pi, 0), np.pi / 2, -np.pi / 2, 1e-300]
    heading = np.concatenate((rng.uniform(-np.pi, np.pi, 80_000), ends.ravel(), tiny, own))
    poses = np.stack((heading / 7, -heading / 3, heading), axis=-1)
    t = 1.2e9 + 0.1 * np.arange(len(heading), dtype=np.float64)
    write_tum(tmp_path / "path.tum", t, poses)
    times, found = read_tum(tmp_path / "path.tum")
    assert times.tobytes() == t.tobytes()
    assert found.tobytes() == poses.tobytes()


def test_evo_reads_the_same_path(tmp_path: Path):
    rng = np.random.default_rng(5)
    poses = rng.uniform(-3, 3, (40, 3))
    write_tum(tmp_path / "path.tum", np.arange(40.0), poses)
    path = file_interface.read_tum_trajectory_file(tmp_path / "path.tum")
    assert path.check()[0]
    np.testing.assert_array_equal(path.positions_xyz[:, :2], poses[:, :2])
    np.testing.assert_allclose(path.get_orientations_euler("sxyz")[:, 2], poses[:, 2], atol=1e-14)


def test_the_other_quaternion_of_a_turn_is_the_same_turn(tmp_path: Path):
    (tmp_path / "a.tum").write_text("0 0 0 0 0 0 0.6 0.8\n1 0 0 0 0 0 -0.6 -0.8\n2 0 0 0 0 0 -1 0\n")
    _, poses = read_tum(tmp_path / "a.tum")
    np.testing.assert_allclose(poses[:, 2], [2 * np.arctan2(0.6, 0.8)] * 2 + [np.pi])


@pytest.mark.parametrize("cells", ["1,2,3,0,1,0,0,0,0,0,0", "1,2,3,0,0,0,0", "1,2,3,0,0,0,0,1,"])
def test_commas_count_as_blanks_whatever_the_number_of_columns(cells: str, tmp_path: Path):
    """EuRoC's ground truth has more; the last is sound but for the comma at its end."""
    (tmp_path / "a.tum").write_text(f"# t\n{cells}\n")
    number = len(cells.strip(",").split(","))
    if number == 8:
        np.testing.assert_array_equal(read_tum(tmp_path / "a.tum")[1], [[2, 3, 0]])
    else:
        refused(f"line 2: found {number} columns, expected 8", read_tum, tmp_path / "a.tum")


@pytest.mark.parametrize("comma", [",", ", ", " ,", ",\t"])
def test_commas_may_stand_between_the_numbers(comma: str, tmp_path: Path):
    (tmp_path / "plain.tum").write_text(GOOD)
    head, *rows = GOOD.rstrip().split("\n")
    (tmp_path / "a.tum").write_text("\n".join([head, *(row.replace(" ", comma) for row in rows)]) + "\n")
    for one, other in zip(read_tum(tmp_path / "a.tum"), read_tum(tmp_path / "plain.tum"), strict=True):
        np.testing.assert_array_equal(one, other)
    (tmp_path / "a.tum").write_text("0,5 1,0 2,0 0,0 0,0 0,0 0,0 1,0\n")
    refused_at(
        tmp_path / "a.tum", "line 1: t is '0,5', expected a number with a decimal point", read_tum, tmp_path / "a.tum"
    )


def test_a_repeated_line_is_read_once(tmp_path: Path):
    rows = GOOD.split("\n")
    (tmp_path / "a.tum").write_text("\n".join([*rows[:2], rows[1], rows[1], *rows[2:-1], rows[2], ""]))
    t, poses = read_tum(tmp_path / "a.tum")
    assert t.tolist() == [0.5, 1.5]
    assert len(poses) == 2


def turns(order: str, headings: Sequence[float]) -> str:
    """A path whose quaternions have that order."""
    parts = [{"x": 0.0, "y": 0.0, "z": np.sin(h / 2), "w": np.cos(h / 2)} for h in headings]
    rows = (f"{k} 1 2 0 {' '.join(str(one[letter]) for letter in order)}\n" for k, one in enumerate(parts))
    return "".join(rows)


def test_the_other_order_of_a_quaternion_is_named(tmp_path: Path):
    path, hint = tmp_path / "a.tum", "; the columns are perhaps qw qx qy qz, expected qx qy qz qw"
    for headings in ([0.0, 0.0, 0.0], [0.1, 0.5, 1.0], [0.0, 1.0, 2.0, 3.0], [2.5, 0.0, -1.0]):
        path.write_text(turns("wxyz", headings))
        refused_at(path, hint, read_tum, path)
        path.write_text(turns("xyzw", headings))
        np.testing.assert_allclose(read_tum(path)[1][:, 2], headings, atol=1e-12)
    path.write_text(turns("xyzw", [0.0, 1.0]) + "7 1 2 0 0.6 0 0 0.8\n")
    assert hint not in refusal(read_tum, path)


def test_digits_that_were_lost_in_times_are_named(tmp_path: Path):
    path = tmp_path / "a.tum"
    for start, step, lost in ((1.7e9, 0.1, True), (123456.0, 0.3, True), (1.7e9, 1.0, True), (5.0, 0.0, False)):
        rows = [f"{start + k * step:g} {k} 0 0 0 0 0 1" for k in range(20)]
        path.write_text("\n".join(rows))
        found = refusal(read_tum, path)
        assert ("perhaps %g wrote them, where %.9f keeps the others" in found) == lost
    path.write_text("\n".join(f"{1.7e9 + 0.1 * (k // 2)!r} {k} 0 0 0 0 0 1" for k in range(20)))
    assert "perhaps" not in refusal(read_tum, path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("0 1 2 0 0 0 0\n", "line 1: found 7 columns, expected 8 (t,x,y,z,qx,qy,qz,qw)"),
        (GOOD + "2.5 1 2 0 0 0 0 one\n", "line 4: qw is 'one', expected a number"),
        (GOOD + "\n# late\n1.5 1 2 0 0 0 0 1\n", "line 6: t is 1.5, expected later than 1.5"),
        (GOOD + "2.5 nan 2 0 0 0 0 1\n", "line 4: x is nan, expected a finite number"),
        (GOOD + "2.5 1 2 0 1 0 0 0\n", "line 4: qz and qw are both 0"),
        (GOOD + "2.5 1 2 0 0 0.5 0 1\n", "line 4: the quaternion has length 1.12, expected 1"),
        (GOOD + "2.5 1 2 0 0 0.6 0 0.8\n", "line 4: the pose is tilted by 74 degrees, expected one on a floor"),
        (GOOD + "2.5 1 2e12 0 0 0 0 1\n", "line 4: y is 2000000000000.0, expected metres, at most 1e+09"),
        ("", "the file is empty"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, content: str, words: str):
    path = tmp_path / "truth.tum"
    path.write_text(content)
    refused_at(path, words, read_tum, path)
