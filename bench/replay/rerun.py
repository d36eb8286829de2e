"""Writes a replay for the Rerun viewer: one entity per backend. Its y points down, so every y is negated."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.files import replaced
from ...core.se2 import Array
from ...frontend.maps.occupancy import WALL
from .grids import Raster
from .view import Panel, View, ellipses

INSTALL = "pip install 'slamduel[replay]'"

NEEDLE = 1.0  # m, of a measured heading
GREY, PALE = (140, 140, 140), (190, 190, 190)


def require() -> None:
    """Raises InputError, with the way to get it, where Rerun is not installed."""
    if find_spec("rerun") is None:
        raise InputError(f"--out: a .rrd file is written with rerun-sdk, which is not installed; {INSTALL} has it.")


def write_rrd(path: Path, view: View) -> None:
    """Writes all frames, and a layout with the backends side by side."""
    require()
    import rerun as rr
    import rerun.blueprint as rrb

    names = [f"backends/{_entity(panel.label)}" for panel in view.panels]
    planes = [
        rrb.Spatial2DView(name=panel.label, origin="/", contents=["known/**", f"{name}/**"])
        for panel, name in zip(view.panels, names, strict=True)
    ]
    plots = [
        rrb.TimeSeriesView(name=words, contents=[f"numbers/{what}/**"])
        for what, words in (("error", "error, m"), ("nees", "NEES (1 is consistent)"), ("step", "step, µs"))
    ]
    layout = rrb.Vertical(rrb.Grid(*planes), rrb.Horizontal(*plots), row_shares=[3, 1])
    recording = rr.RecordingStream("slamduel")
    with replaced(path) as part:
        recording.save(part, default_blueprint=rrb.Blueprint(layout, collapse_panels=True))
        recording.log("known/landmarks", rr.Points2D(_turned(view.places), colors=GREY, radii=-3.0), static=True)
        recording.log(
            f"known/{view.known or 'path'}", rr.LineStrips2D(_strips(view.truth), colors=PALE, radii=-1.0), static=True
        )
        for panel in view.panels:
            for what in ("error", "nees", "step"):
                series = rr.SeriesLines(colors=_rgb(panel), names=panel.label)
                recording.log(f"numbers/{what}/{_entity(panel.label)}", series, static=True)
        for frame in range(len(view.steps)):
            recording.set_time("step", sequence=int(view.steps[frame]))
            recording.set_time("seconds", duration=float(view.t[frame]))
            until = int(view.at[frame])
            recording.log("known/dead-reckoning", rr.LineStrips2D(_strips(view.reckoned[:until]), colors=GREY))
            if np.isfinite(view.positions.xy[frame]).all():
                recording.log("known/positions", rr.Points2D(_turned(view.positions.xy[None, frame]), colors=GREY))
            if np.isfinite(view.positions.ellipse[frame]).all():
                shape = _ring(view.positions.xy[frame], view.positions.ellipse[frame])
                recording.log("known/position-ellipse", rr.LineStrips2D([shape], colors=GREY))
            for panel, name in zip(view.panels, names, strict=True):
                _grid(rr, recording, panel, name, frame, view.cells)
                if frame < len(panel.pose):
                    _log(rr, recording, panel, name, frame, until)
        recording.flush()
        recording.disconnect()


def _grid(rr: Any, recording: Any, panel: Panel, name: str, frame: int, cells: Raster | None) -> None:
    """Logs the walls where a new grid begins, and at every frame the newest scan."""
    for sketch in panel.grids if cells is not None else ():
        if cells is not None and sketch.frame == frame:
            walls = cells.origin + cells.size * (np.argwhere(sketch.states == WALL) + 0.5)
            recording.log(f"{name}/walls", rr.Points2D(_turned(walls), colors=GREY, radii=cells.size / 2))
    if frame < len(panel.hits):
        recording.log(f"{name}/scan", rr.Points2D(_turned(panel.hits[frame]), colors=_rgb(panel), radii=-1.5))


def _log(rr: Any, recording: Any, panel: Panel, name: str, frame: int, until: int) -> None:
    colour, known, seen = _rgb(panel), panel.maps[frame], panel.sighted[frame]
    trail = panel.trail[:until]
    recording.log(f"{name}/path", rr.LineStrips2D(_strips(trail), colors=colour))
    recording.log(f"{name}/pose", rr.Points2D(_turned(panel.pose[frame, None, :2]), colors=colour, radii=-5.0))
    labels = [str(i) for i in known.ids]
    landmarks = rr.Points2D(_turned(known.xy), colors=colour, radii=-3.0, labels=labels, show_labels=False)
    recording.log(f"{name}/landmarks", landmarks)
    centres = np.concatenate((known.xy, panel.pose[frame, None, :2]))
    shapes = np.concatenate((ellipses(known.cov), panel.ellipse[frame, None]))
    rings = [_ring(centre, shape) for centre, shape in zip(centres, shapes, strict=True) if np.isfinite(shape).all()]
    recording.log(f"{name}/ellipses", rr.LineStrips2D(rings, colors=colour))
    rays = [_turned(np.stack((seen.origin, end))) for end in seen.ends]
    rays += [_ring(seen.origin, np.array((r, r, 0.0))) for r in seen.rings]
    recording.log(f"{name}/sightings", rr.LineStrips2D(rays, colors=(*colour, 120)))
    lines = [piece for line in panel.places[frame] for piece in _strips(line)]
    recording.log(f"{name}/open-landmarks", rr.LineStrips2D(lines, colors=(*colour, 120), radii=-2.0))
    x, y, heading = panel.pointed[frame]
    needle = np.array([(x, y), (x + NEEDLE * np.cos(heading), y + NEEDLE * np.sin(heading))])
    recording.log(f"{name}/heading", rr.LineStrips2D(_strips(needle), colors=GREY))
    for what, values in (("error", panel.error), ("nees", panel.nees), ("step", panel.step_us)):
        if np.isfinite(values[frame]):
            recording.log(f"numbers/{what}/{_entity(panel.label)}", rr.Scalars(float(values[frame])))


def _ring(centre: Array, shape: Array) -> Array:
    """An ellipse as a line, (17, 2)."""
    around = np.linspace(0, 2 * np.pi, 17)
    x, y = shape[0] * np.cos(around), shape[1] * np.sin(around)
    c, s = np.cos(shape[2]), np.sin(shape[2])
    return _turned(np.column_stack((centre[0] + c * x - s * y, centre[1] + s * x + c * y)))


def _strips(xy: Array) -> list[Array]:
    """The stretches of a path that are known."""
    gaps = np.flatnonzero(~np.isfinite(xy).all(axis=1))
    pieces = [piece[np.isfinite(piece).all(axis=1)] for piece in np.split(xy, gaps)]
    return [_turned(piece) for piece in pieces if len(piece) > 1]


def _turned(xy: Array) -> Array:
    return xy * (1.0, -1.0)


def _entity(label: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "-" for c in label)


def _rgb(panel: Panel) -> tuple[int, int, int]:
    red, green, blue = (int(panel.look.colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue
