"""Files of maps: occupancy grids as a picture, for ROS's map_server and to localise on; views from above; points.

https://wiki.ros.org/map_server: a PGM whose pixels are 0 for a wall, 254 for free, 205 for unknown, and a YAML file
with the size of a cell (m) and the place of the lower left corner (m, m, rad).
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.files import write_whole
from ...datasets.grid_file import write_cells
from ...frontend.maps.cloud import Cloud
from ...frontend.maps.occupancy import FREE, UNKNOWN, WALL, Occupancy
from ...frontend.maps.top_view import TopView

PGM = {UNKNOWN: 205, FREE: 254, WALL: 0}


def write_grid(folder: Path, grid: Occupancy) -> None:
    """Writes grid.png, grid.pgm, grid.yaml and grid.npz to `folder`; OSError where that is impossible."""
    write_ros_map(folder, grid)
    write_cells(folder, grid)
    _write_png(folder / "grid.png", grid.picture)


def write_seen(folder: Path, grid: Occupancy, view: TopView, cloud: Cloud) -> None:
    """Writes top.png, grid.pgm, grid.yaml and points.ply to `folder`; OSError where that is impossible."""
    write_ros_map(folder, grid)
    _write_png(folder / "top.png", view.picture[:, :, ::-1])
    write_whole(folder / "points.ply", ply(cloud))


def write_ros_map(folder: Path, grid: Occupancy) -> None:
    """Writes grid.pgm and grid.yaml to `folder`; OSError where that is impossible."""
    folder.mkdir(parents=True, exist_ok=True)
    values = np.zeros(3, np.uint8)
    values[list(PGM)] = list(PGM.values())
    pixels = np.ascontiguousarray(values[grid.states].T[::-1])
    height, width = pixels.shape
    write_whole(folder / "grid.pgm", f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
    x, y = grid.origin.tolist()
    write_whole(
        folder / "grid.yaml",
        f"image: grid.pgm\nresolution: {grid.size!r}\norigin: [{x!r}, {y!r}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
    )


def ply(cloud: Cloud) -> bytes:
    """The content of a binary PLY file, little-endian, of coloured points.

    http://paulbourke.net/dataformats/ply: CloudCompare, MeshLab and Open3D read x, y, z, red, green and blue.
    """
    vertices = np.zeros(len(cloud.points), [*((axis, "<f4") for axis in "xyz"), *((name, "u1") for name in RGB)])
    for column, axis in enumerate("xyz"):
        vertices[axis] = cloud.points[:, column]
    for column, name in enumerate(RGB):
        vertices[name] = cloud.colours[:, column]
    properties = [f"property float {axis}" for axis in "xyz"] + [f"property uchar {name}" for name in RGB]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}", *properties, "end_header"]
    return "\n".join(head).encode() + b"\n" + vertices.tobytes()


RGB = ("red", "green", "blue")


def _write_png(path: Path, picture: NDArray[np.uint8]) -> None:
    _, png = cv2.imencode(".png", picture)
    write_whole(path, png.tobytes())
