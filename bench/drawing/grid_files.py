"""Files of an occupancy grid: a picture, the map that ROS's map_server reads, and the cells to localise on.

https://wiki.ros.org/map_server: a PGM whose pixels are 0 for a wall, 254 for free, 205 for unknown, and a YAML file
with the size of a cell (m) and the place of the lower left corner (m, m, rad).
"""

from pathlib import Path

import cv2
import numpy as np

from ...datasets.grid_file import write_cells
from ...frontend.files import write_whole
from ...frontend.laser.occupancy import FREE, UNKNOWN, WALL, Occupancy

PGM = {UNKNOWN: 205, FREE: 254, WALL: 0}


def write_grid(folder: Path, grid: Occupancy) -> None:
    """Writes grid.png, grid.pgm, grid.yaml and grid.npz to `folder`; OSError where that is impossible."""
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
    write_cells(folder, grid)
    _, png = cv2.imencode(".png", grid.picture)
    write_whole(folder / "grid.png", png.tobytes())
