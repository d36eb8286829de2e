"""All paths in one picture, over the known one."""

from typing import Any

from matplotlib.figure import Figure

from ..drawing.axes import legend
from ..drawing.figure import Exhibit
from ..drawing.figure_maker import WIDTH, exhibit, of
from ..drawing.legend import ROW, named
from ..words.numerals import listed, number
from .aligned_paths import framed, panels
from .drawn_log import Scene
from .trajectories import beyond, plane, tall


def overlay(name: str, scene: Scene) -> Exhibit | None:
    """Online paths, and final ones of backends that have no other. None where there are no two."""
    every = panels(scene)
    if len(every) < 2:
        return None
    frame = framed(scene, every)
    key = named([panel.trace.label for panel in every], scene.order)

    def draw(figure: Figure) -> None:
        axes = plane(figure, scene, frame)
        for panel in every:
            look, path = panel.trace.look, panel.final if panel.online is None else panel.online
            if path is not None:
                line: dict[str, Any] = {"linestyle": look.dash, "linewidth": 1.1, "alpha": key.alpha(panel.trace.label)}
                axes.plot(*path.T, color=look.colour, label=key.called(panel.trace.label), gid=of(look), **line)
        key.others(axes)
        legend(figure, axes, key.columns)

    caption = f"{scene.which.capitalize()}." * bool(scene.which)
    if scene.kind:
        caption += f" Plain line: {scene.kind}" + ("; crosses: landmarks." if "xy" in scene.known else ".")
    caption += " Online paths; of a backend without one, the path smoothed at the end." * any(
        panel.online is None for panel in every
    )
    far = {panel.trace.label: beyond(frame, panel.final if panel.online is None else panel.online) for panel in every}
    cut = [f"{key.tags[label]} (by up to {number(by)} m)" for label, by in far.items() if by > 0]
    caption += f" Beyond the frame: {listed(cut)}." if cut else ""
    curves = [curve for panel in every for curve in panel.curves if curve.final == (panel.online is None)]
    height = tall(frame, WIDTH) + ROW * key.rows
    return exhibit(name, "All paths", caption.strip(), height, draw, curves=curves)
