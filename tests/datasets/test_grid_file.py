"""Files of occupancy grids: what is written is read, maps of ROS are understood, and what cannot be used is named."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from refusals import refused, refused_at
from slamduel import run
from slamduel.bench.cli import main
from slamduel.bench.drawing.map_files import write_grid
from slamduel.datasets.grid_file import NAME, read_grid
from slamduel.frontend.maps.occupancy import FREE, UNKNOWN, WALL, Occupancy, of_states


@pytest.fixture
def grid() -> Occupancy:
    states = np.random.default_rng(0).choice(np.array([UNKNOWN, FREE, WALL], np.uint8), (31, 17))
    return of_states(np.array((-3.25, 4.5)), 0.05, states)


def test_cells_come_back_as_they_were(grid: Occupancy, tmp_path: Path) -> None:
    write_grid(tmp_path, grid)
    again = read_grid(tmp_path)
    assert np.array_equal(again.cells, grid.cells)
    assert np.array_equal(again.origin, grid.origin)
    assert again.size == grid.size


def test_a_map_of_ros_has_the_same_walls(grid: Occupancy, tmp_path: Path) -> None:
    write_grid(tmp_path, grid)
    again = read_grid(tmp_path / "grid.yaml")
    assert np.array_equal(again.states, grid.states)
    assert np.array_equal(again.origin, grid.origin)
    (tmp_path / NAME).unlink()
    assert np.array_equal(read_grid(tmp_path).states, grid.states)  # a folder of a map of ROS


def test_a_map_from_elsewhere_is_read_as_map_server_does(tmp_path: Path) -> None:
    """Dark is a wall unless negated; the first row of the picture is the northernmost."""
    pixels = np.array([[0, 254, 205], [254, 254, 254]], np.uint8)
    cv2.imwrite(str(tmp_path / "floor.png"), pixels)
    words = "image: floor.png\nresolution: 0.1\norigin: [-1.0, 2, 0]\nnegate: {}\nmode: trinary\n"
    (tmp_path / "floor.yaml").write_text(words.format(0))
    found = read_grid(tmp_path / "floor.yaml")
    assert found.states.tolist() == [[FREE, WALL], [FREE, FREE], [FREE, UNKNOWN]]  # x, then y upwards
    (tmp_path / "floor.yaml").write_text(words.format(1))
    assert read_grid(tmp_path / "floor.yaml").states[0].tolist() == [WALL, FREE]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("image: grid.pgm", "image: other.pgm"), "is not there, expected that of the map"),
        (("image: grid.pgm", "image: grid.yaml"), "is no picture that can be read, expected that of the map"),
        (("image: grid.pgm", "picture: grid.pgm"), "has no image, expected image, resolution and origin"),
        (("resolution: 0.05", "resolution: 5"), "resolution is 5, expected 0.005 to 1"),
        (("resolution: 0.05", "resolution: fine"), "resolution is 'fine', expected 0.005 to 1"),
        ((", 0.0]", ", 0.5]"), "origin is turned by 0.5 rad, expected a map that is not"),
        (("origin: [", "origin: [1, "), "expected [x, y, yaw] in m and rad"),
        (("free_thresh: 0.196", "free_thresh: 0.9"), "free_thresh is 0.9 and occupied_thresh 0.65, expected it below"),
        (("negate: 0", "mode: raw"), "mode is 'raw', expected trinary or scale"),
        (("image: grid.pgm", "image: ["), "is no YAML"),
    ],
)
def test_a_map_of_ros_that_is_none_is_named(
    change: tuple[str, str], said: str, grid: Occupancy, tmp_path: Path
) -> None:
    write_grid(tmp_path, grid)
    path = tmp_path / "grid.yaml"
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    refused_at(path, said, read_grid, path)


def test_cells_that_cannot_be_used_are_named(grid: Occupancy, tmp_path: Path) -> None:
    def other(said: str, **columns: np.ndarray) -> None:
        write_grid(tmp_path, grid)
        with np.load(tmp_path / NAME) as file:
            found = {name: file[name] for name in file.files}
        found |= columns
        np.savez(tmp_path / NAME, **{name: column for name, column in found.items() if column.size})
        refused_at(tmp_path / NAME, said, read_grid, tmp_path)

    other("expected origin, size, hits, through, x, y", hits=np.zeros(0))
    other("through is float64 of the shape (3, 3), expected finite numbers of (31, 17)", through=np.zeros((3, 3)))
    other("x is float64 of the shape (31, 17), expected finite", x=np.full((31, 17), np.nan))
    other("origin is [1e+99, 0.0], expected metres, at most 1e+08", origin=np.array([1e99, 0.0]))
    other("found cells of 7 m, expected two-dimensional ones of 0.005 to 1 m", size=np.array(7.0))
    other("has no wall, expected a map to localise on", hits=np.zeros((31, 17)))
    write_grid(tmp_path, grid)
    content = (tmp_path / NAME).read_bytes()
    (tmp_path / NAME).write_bytes(content[: len(content) // 2])
    refused("is damaged or no file of a grid", read_grid, tmp_path)
    refused("there is no such folder, expected a folder of bench map", read_grid, tmp_path / "elsewhere")
    (tmp_path / "empty").mkdir()
    refused(r"there is no grid\.npz, expected a folder of bench map; bench map RESULTS", read_grid, tmp_path / "empty")


@pytest.mark.usefixtures("no_report")
def test_a_run_on_the_grid_of_an_earlier_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("laser-floor[laps=0.4,people=0]", ["graph"], seeds=1, out=tmp_path / "first")
    assert main(["map", str(tmp_path / "first"), "--out", str(tmp_path / "grids"), "--quiet"]) == 0
    (place,) = (file.parent for file in (tmp_path / "grids").rglob(NAME))
    again = "laser-floor[laps=0.2,people=0]"
    every_seed = str(place.parent.parent / "*" / place.name)
    found = run(again, ["dead-reckoning", "graph"], seeds=1, map=every_seed, out=tmp_path / "second")
    (cells,) = ({row["backend"]: row for row in found.cells},)
    assert cells["graph"]["status"] == "done"
    assert cells["graph"]["final_ate_m"] < 0.03
    assert "grid=" in cells["graph"]["dataset_options"]
    words = ["run", "--out", str(tmp_path / "third"), "--backend", "ekf", "--map", str(place)]
    assert main([*words, "--dataset", "circle"]) == 2
    assert "is an occupancy grid, and circle takes none; expected a laser log" in capsys.readouterr().err
    assert main([*words, "--dataset", again, "--map-fixed"]) == 2
    assert "is an occupancy grid, which is fixed as it is; expected it without" in capsys.readouterr().err
    assert main(["run", "--out", str(tmp_path / "third"), "--dataset", "laser-floor[start=unknown]"]) == 2
    assert "option start=unknown: there is no grid to find it on" in capsys.readouterr().err
