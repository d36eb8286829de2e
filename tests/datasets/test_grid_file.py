"""Grids to localise on: what bench map wrote is read again, a map of ROS with its walls, and damage is a sentence."""

from pathlib import Path

import numpy as np
import pytest

from slamduel.bench.drawing.grid_files import write_grid
from slamduel.datasets.grid_file import read_grid
from slamduel.frontend.errors import InputError
from slamduel.frontend.laser.occupancy import FREE, UNKNOWN, WALL, Occupancy


def small() -> Occupancy:
    """Five cells by three: a wall of two, free ground, and what nobody has seen."""
    cells = np.zeros((5, 3, 4), np.float32)
    cells[1, 1:, 0] = 4.0
    cells[1, 1:, 2:] = 0.1
    cells[2:4, :2, 1] = 7.0
    return Occupancy(np.array((-2.5, 1.25)), 0.05, cells)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_grid(tmp_path / "grid", small())
    return tmp_path / "grid"


def test_what_was_written_is_read_to_the_last_bit(folder: Path) -> None:
    found = read_grid(folder)
    assert found.cells.tobytes() == small().cells.tobytes()
    assert (found.origin.tolist(), found.size) == ([-2.5, 1.25], 0.05)


def test_a_map_of_ros_has_the_same_walls_at_the_same_place(folder: Path) -> None:
    found = read_grid(folder / "grid.yaml")
    assert found.states.tolist() == small().states.tolist()
    assert {FREE, UNKNOWN, WALL} == set(found.states.ravel().tolist())
    assert (found.origin.tolist(), found.size) == ([-2.5, 1.25], 0.05)


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        ("resolution: 0.05\n", "", "has no resolution, expected image, resolution and origin"),
        ("image: grid.pgm\n", "", "has no image, expected image, resolution and origin"),
        ("origin: [-2.5, 1.25, 0.0]\n", "", "has no origin, expected image, resolution and origin"),
        ("resolution: 0.05", "resolution: -1", "resolution is -1, expected 0.005 to 1"),
        ("1.25, 0.0]", "1.25, 0.5]", "origin is turned by 0.5 rad, expected a map that is not"),
        ("1.25, 0.0]", "1.25]", r"origin is \[-2.5, 1.25\], expected \[x, y, yaw\]"),
        ("grid.pgm", "other.pgm", "other.pgm is not there, expected that of the map"),
        ("free_thresh: 0.196", "free_thresh: 0.7", "free_thresh is 0.7 and occupied_thresh 0.65, expected it below"),
        ("image: grid.pgm\n", "image: [grid.pgm\n", "is no YAML"),
    ],
)
def test_a_wrong_yaml_is_a_sentence(folder: Path, before: str, after: str, sentence: str) -> None:
    file = folder / "grid.yaml"
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after))
    with pytest.raises(InputError, match=f"grid.yaml: .*{sentence}"):
        read_grid(file)


def test_a_damaged_file_is_a_sentence(folder: Path) -> None:
    whole = (folder / "grid.npz").read_bytes()
    for cut in (0, 30, len(whole) // 2, len(whole) - 5):
        (folder / "grid.npz").write_bytes(whole[:cut])
        with pytest.raises(InputError, match=r"grid\.npz: is damaged or no grid"):
            read_grid(folder)
    (folder / "grid.pgm").write_bytes(b"P5\n5 3\n")
    with pytest.raises(InputError, match=r"grid\.pgm is no picture that can be read"):
        read_grid(folder / "grid.yaml")
    with pytest.raises(InputError, match="nowhere: there is no such folder, expected a folder of bench map"):
        read_grid(folder / "nowhere")
