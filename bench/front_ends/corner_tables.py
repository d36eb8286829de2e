"""Writes the study of corner refinements as tables for the terminal, and as rows of the CSV."""

import math
from collections.abc import Sequence

from rich.table import Table

from .cameras import PACE, CameraAccuracy
from .corners import CROWD, REFINEMENTS, Accuracy, Cost, Misreadings
from .tables import plain

CORNER_COLUMNS = (
    *("study", "refinement", "width", "height", "distance_m", "streak_px", "frames", "sightings", "wrong"),
    *("camera", "cpu_ms", "bias_m", "sd_m", "bearing_bias_rad", "nees", "nees_half"),
)

FIGURES = ("bias, %", "bias, mm", "sd, mm", "bearing bias, °", "NEES")

NEES = "NEES: mean normalised squared error of range and bearing over its 2 degrees of freedom; 1 is exact"

Row = Cost | Accuracy | Misreadings | CameraAccuracy


def cost_table(costs: Sequence[Cost]) -> Table:
    """Makes the table of CPU time, frame rate and ratio, one row per refinement, columns per frame size."""
    cameras = list(dict.fromkeys(cost.camera for cost in costs))
    headings = [
        heading
        for camera in cameras
        for heading in (f"{camera.width}x{camera.height}, ms", "a second", f"of {REFINEMENTS[0]}")
    ]
    table = plain(f"CPU time of a frame with {CROWD} markers, one thread", ["refinement"], headings)
    base = {cost.camera: cost.ms for cost in costs if cost.refinement == REFINEMENTS[0]}
    for name in dict.fromkeys(cost.refinement for cost in costs):
        mine = {cost.camera: cost for cost in costs if cost.refinement == name}
        cells = [
            (f"{c.ms:.1f}", f"{c.rate:.0f}", f"{c.ms / base[c.camera]:.2f}") for c in map(mine.__getitem__, cameras)
        ]
        table.add_row(name, *(text for cell in cells for text in cell))
    return table


def accuracy_table(rows: Sequence[Accuracy]) -> Table:
    """Makes the table of every refinement at every distance."""
    streak = rows[0].streak
    camera = f"a camera that moves, streaks up to {streak:g} px" if streak else "a still camera"
    headings = ("found", "wrong", *FIGURES)
    table = plain(f"{rows[0].placements} placements a distance, {camera}", ["m", "refinement"], headings, NEES)
    for index, row in enumerate(rows):
        first = index == 0 or rows[index - 1].distance != row.distance
        table.add_row(
            f"{row.distance:g}" if first else "",
            row.refinement,
            f"{100 * row.found / row.placements:.1f} %",
            str(row.wrong),
            *_figures(row),
            end_section=index + 1 < len(rows) and rows[index + 1].distance != row.distance,
        )
    return table


def camera_table(rows: Sequence[CameraAccuracy]) -> Table:
    """Makes the table of every camera at one distance; a marker that is there and not found is refused."""
    first = rows[0].accuracy
    title = f"{first.placements} placements {first.distance:g} m away, by camera and print; motion up to {PACE:g} px/s"
    table = plain(title, ["camera", "refinement"], ("refused", "wrong", *FIGURES), NEES)
    cameras = [row.camera for row in rows]
    for index, (camera, row) in enumerate(rows):
        table.add_row(
            camera if camera not in cameras[:index] else "",
            row.refinement,
            f"{100 * row.refused:.1f} %",
            str(row.wrong),
            *_figures(row),
            end_section=camera not in cameras[index + 1 :],
        )
    return table


def misreading_table(rows: Sequence[Misreadings]) -> Table:
    """Makes the table of wrong ids."""
    table = plain("Ids that are not there", ["frames of", "refinement"], ["frames", "sightings", "wrong ids"])
    for row in rows:
        table.add_row(row.kind, row.refinement, f"{row.frames:,}", f"{row.sightings:,}", str(row.wrong))
    return table


def record(row: Row) -> dict[str, str | int | float]:
    """The columns of a row."""
    if isinstance(row, Cost):
        size = {"width": row.camera.width, "height": row.camera.height}
        return {"study": "cost", "refinement": row.refinement, **size, "frames": row.frames, "cpu_ms": row.ms}
    if isinstance(row, Misreadings):
        counts = {"frames": row.frames, "sightings": row.sightings, "wrong": row.wrong}
        return {"study": row.kind, "refinement": row.refinement, **counts}
    if isinstance(row, CameraAccuracy):
        return {**record(row.accuracy), "study": "cameras", "camera": row.camera}
    figures = {
        "bias_m": row.bias,
        "sd_m": row.sd,
        "bearing_bias_rad": row.bearing_bias,
        "nees": row.nees,
        "nees_half": row.nees_half,
    }
    return {
        "study": "moving" if row.streak else "still",
        "refinement": row.refinement,
        "distance_m": row.distance,
        "streak_px": row.streak,
        "frames": row.placements,
        "sightings": row.found,
        "wrong": row.wrong,
        **{name: "" if math.isnan(figure) else figure for name, figure in figures.items()},
    }


def _figures(row: Accuracy) -> Sequence[str]:
    """The cells of FIGURES, blank where too few were found."""
    if math.isnan(row.bias):
        return [""] * len(FIGURES)
    return (
        f"{100 * row.bias / row.distance:+.3f}",
        f"{1e3 * row.bias:+.2f}",
        f"{1e3 * row.sd:.2f}",
        f"{math.degrees(row.bearing_bias):+.4f}",
        f"{row.nees:.2f} ± {row.nees_half:.2f}",
    )
