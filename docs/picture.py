"""The README's picture, from the record that `make demo` leaves: what the camera sees, and where backends think it is.

.venv/bin/python docs/picture.py results/demo docs/picture.png
"""

import sys
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

from ..bench.record.reader import Store
from ..bench.verdict.summary import lines
from ..core.se2 import Array
from ..datasets.cache import generator
from ..datasets.worlds.aruco_room import Options, record

SEED = 2
FRAME = 30
COLOURS = {
    "dead-reckoning": "#999999",
    "fastslam": "#d55e00",
    "ekf": "#0072b2",
    "isam2": "#009e73",
    "smoother": "#cc79a7",
}


def main(results: Path, picture: Path) -> None:
    """Draw the picture."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    camera, plan = figure.subplots(1, 2, width_ratios=(1.05, 1))
    camera.imshow(annotated_frame(FRAME))
    camera.set_title(f"one of 301 rendered frames, markers found in it (t = {FRAME / 5:.0f} s)", fontsize=10)
    camera.set_axis_off()
    with Store(results) as store:
        truth = store.truth("aruco-room", "", SEED)
        plan.plot(*truth["poses"][:, :2].T, color="black", linewidth=4, alpha=0.25, label="truth")
        plan.plot(*truth["xy"].T, "s", color="black", markersize=4, alpha=0.5, label="markers")
        found = {line.backend: line for line in lines(store.cells()) if line.dataset == "aruco-room"}
        for backend, colour in COLOURS.items():
            row = next(row for row in found[backend].rows if row.columns["seed"] == SEED)
            path, error = store.arrays(row)["online"], row.columns["ate_origin_m"]
            plan.plot(*path[:, :2].T, color=colour, linewidth=1.2, label=f"{backend}  {1000 * error:.0f} mm")
    plan.set_aspect("equal")
    plan.set_xlabel("x, m")
    plan.set_ylabel("y, m")
    plan.set_title("online paths from the known start, and their error (RMSE)", fontsize=10)
    plan.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=9)
    plan.spines[["top", "right"]].set_visible(False)
    figure.savefig(picture, dpi=110)


def annotated_frame(number: int) -> Array:
    """Frame `number` of the log, in colour, the detected markers outlined with their ids."""
    recording = record(Options(), generator("aruco-room", SEED))[0]
    image = next(islice(recording.frames, number, None)).image
    sightings, _ = recording.detector.detect(image)
    colour = cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    corners = [sighting.corners.astype(np.float32)[None] for sighting in sightings]
    return cv2.aruco.drawDetectedMarkers(colour, corners, np.array([s.id for s in sightings]), (0, 114, 178))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
