"""Maps of a run on a depth camera's log: views in the report, and the files of bench map."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import depth_clouds as room
from slamduel import run
from slamduel.bench.cli import main
from slamduel.bench.drawing.map_files import ply
from slamduel.bench.record.store import Store
from slamduel.core.factors import Log, Prior
from slamduel.core.se2 import Array, between
from slamduel.datasets.formats import log_folder
from slamduel.frontend.maps.cloud import Cloud

STEPS = len(room.PATH)


def points_of(path: Path) -> tuple[Array, Array]:
    """Reads a PLY file, by its header alone: places (n, 3) and colours (n, 3)."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = head.decode("ascii").split("\n")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    (count,) = (int(line.split()[2]) for line in lines if line.startswith("element vertex "))
    sizes = {"float": "<f4", "uchar": "u1"}
    form = [(words[2], sizes[words[1]]) for line in lines if (words := line.split()) and words[0] == "property"]
    assert [name for name, _ in form] == ["x", "y", "z", "red", "green", "blue"]
    assert len(body) == count * np.dtype(form).itemsize
    rows = np.frombuffer(body, form)
    return np.column_stack([rows[a] for a in "xyz"]), np.column_stack([rows[a] for a in ("red", "green", "blue")])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run on exact odometry through a room whose walls are known, with the clouds of its camera."""
    home, n, none = tmp_path_factory.mktemp("views"), STEPS, np.zeros(0, np.int64)
    delta = np.concatenate((np.zeros((1, 3)), between(room.PATH[:-1], room.PATH[1:])))
    log = Log.from_arrays(
        "room", Prior(room.PATH[0], 1e-6 * np.eye(3)), np.arange(float(n)), delta, np.tile(1e-6 * np.eye(3), (n, 1, 1)),
        none, none, np.zeros((0, 2)), np.zeros((0, 2, 2)), loop_step=np.array([5]), loop_to=np.array([0]),
        loop_delta=between(room.PATH[:1], room.PATH[5:6]), loop_cov=1e-6 * np.eye(3)[None],
    )  # fmt: skip
    object.__setattr__(log, "clouds", room.room_clouds())
    log_folder.write(home / "log", log, None)
    run(str(home / "log"), ["dead-reckoning", "graph"], out=home / "out")
    return home / "out"


def test_the_report_has_a_view_for_each_backend(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert "Views from above" in page
    assert "Occupancy grids" not in page
    assert "up to 1 m above the floor" in page
    assert page.count("data:image/png;base64") == 2
    assert len(list((folder / "figures").glob("*-grid-*.svg"))) == 2
    assert "### Views from above" in (folder / "report.md").read_text()


def test_bench_map_writes_a_view_a_map_for_ros_and_points(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["map", str(folder), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.count("cells of 0.05 m, obstacles from 0.1 to 1 m; ") == 2
    assert said.endswith("each: top.png, from above; grid.pgm and grid.yaml, a map for ROS; points.ply, the points\n")
    places = sorted(file.parent for file in tmp_path.rglob("points.ply"))
    assert [place.name for place in places] == ["dead-reckoning", "graph"]
    for place in places:
        assert {one.name for one in place.iterdir()} == {"top.png", "grid.pgm", "grid.yaml", "points.ply"}
        words = dict(line.split(": ", 1) for line in (place / "grid.yaml").read_text().splitlines())
        origin = np.array([float(one) for one in words["origin"].strip("[]").split(",")])[:2]
        pixels = cv2.imread(str(place / "grid.pgm"), cv2.IMREAD_UNCHANGED)
        assert pixels is not None
        assert set(np.unique(pixels)) == {0, 205, 254}
        row, column = np.nonzero(pixels == 0)
        at: Array = origin + 0.05 * np.column_stack((column + 0.5, len(pixels) - 1 - row + 0.5)).astype(float)
        on_wall = np.abs(np.abs(at) - np.array(room.HALF)).min(axis=1) < 0.08
        assert (on_wall | room.on_box(at, 0.08)).all()
        assert on_wall.sum() > 200
        picture = cv2.imread(str(place / "top.png"))
        assert (picture == room.FLOOR[::-1]).all(axis=2).mean() > 0.3  # blue, green, red
        points, colours = points_of(place / "points.ply")
        assert f"; {len(points):,} points" in said
        floor = (colours == room.FLOOR).all(axis=1)
        assert np.abs(points[floor, 2]).max() < 0.006
        assert floor.sum() > 1000
        walls = (colours == room.WALLS).all(axis=1)
        off = np.abs(np.abs(points[walls, :2]) - np.array(room.HALF)).min(axis=1)
        assert off.max() < 0.02
        assert len(np.unique(np.floor(points / 0.05), axis=0)) > 0.97 * len(points)  # a mean may be on an edge


def test_heights_and_sizes_are_as_asked(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["map", str(folder), "--out", str(tmp_path)]
    assert main([*words, "--heights", "0.1,1.0"]) == 0
    (place,) = (one.parent for one in tmp_path.rglob("points.ply") if one.parent.name == "dead-reckoning")
    fine = len(points_of(place / "points.ply")[0])
    tall = cv2.imread(str(place / "grid.pgm"), cv2.IMREAD_UNCHANGED)
    assert main([*words, "--heights", "0.6,1.0", "--points", "0.2", "--cell", "0.1", "--online"]) == 0
    said = capsys.readouterr().out
    assert said.count("obstacles from 0.6 to 1 m") == said.count("the online path") - 1 == 1  # graph has none
    assert len(points_of(place / "points.ply")[0]) < fine / 4
    above = cv2.imread(str(place / "grid.pgm"), cv2.IMREAD_UNCHANGED)
    assert above is not None
    assert above.shape[0] < 0.6 * tall.shape[0]
    origin = re.search(r"origin: \[(.*), (.*), 0.0\]", (place / "grid.yaml").read_text())
    column, row = np.floor((room.BOX.place[:2] - [float(origin[1]), float(origin[2])]) / 0.1).astype(int)
    around = above[len(above) - 1 - row - 2 : len(above) - 1 - row + 3, column - 2 : column + 3]
    assert (around != 0).all()  # the box is 0.5 m high
    for heights in ("1,0.1", "0.1", "a,b", "0.1,1000", "-1,1", "0,1"):
        assert main([*words, f"--heights={heights}"]) == 2
        assert "expected two heights above 0 and up to 100 m, the lower one first" in capsys.readouterr().err


def test_damaged_clouds_in_the_record_are_none(folder: Path) -> None:
    with Store(folder) as store:
        row = next(iter(store.cells()))
        clouds = store.clouds(row)
        assert store.scans(row) is None
        np.testing.assert_array_equal(clouds.points, room.room_clouds().points)
        short = row._replace(columns={**row.columns, "steps": STEPS - 1})
        assert store.clouds(short) is None


def test_points_without_any_are_a_file() -> None:
    content = ply(Cloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0)))
    assert b"element vertex 0\n" in content
    assert content.endswith(b"end_header\n")
