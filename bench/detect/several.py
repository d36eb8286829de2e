"""Makes an opened recording of markers and laser scans into one log with one report."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...core.factors import Log
from ...core.se2 import between, compose
from ...datasets.recordings.several import OpenedSeveral, finished
from ...frontend.markers.pipeline import Recording
from ...frontend.several.log import Built, build
from ..drawing.figure import ReportFigure
from ..words.numerals import counted, number
from ..words.styles import COLOURS
from .folder import Request, written
from .laser import LaserFindings
from .markers import MarkerFindings, Observe, gathered


@dataclass(frozen=True, eq=False)
class SeveralFindings(MarkerFindings):
    """The findings in frames and scans."""

    template: ClassVar[str] = "detection_several.html.jinja"

    laser: LaserFindings = field(kw_only=True)  # of the same log

    def headline(self) -> list[str]:
        """Summarises in sentences: the log, then what the camera saw, then how scans matched."""
        steps, loops = counted(len(self.log), "step"), counted(self.laser.loops, "loop closure")
        motions = f"{counted(self.laser.counts['motions'], 'motion')} by the scans alone"
        said = (
            f"Frames and {self.laser.scans} in {number(self.seconds)} s: {steps} over {number(self.way)} m, {motions}, "
            f"{loops}."
        )
        return [said, *super().headline(), *self.laser.matched()]

    def refused(self) -> str:
        """Lists what is left out of the log, and why searches for loops gave none, in a line."""
        return f"{super().refused()} {self.laser.refused()}"

    def advice(self) -> list[str]:
        """Says what looks wrong, in sentences."""
        return [*super().advice(), *self.laser.advice()]

    def numbers(self) -> dict[str, Any]:
        """Returns the counts of frames and markers, and of scans and loops under `laser`."""
        own = {name: n for name, n in self.laser.numbers().items() if name not in ("seconds", "steps")}
        laser = {**own, "motions": self.laser.counts["motions"]}
        return {**super().numbers(), "steps": len(self.log), "laser": laser}

    def figures(self) -> list[ReportFigure]:
        """Draws the paths by wheels and by the laser's front end with its loop closures, and what the camera saw."""
        from .figures import Path as Drawn
        from .figures import path_figure
        from .marker_figures import BY_ODOMETRY

        wheels = Drawn(self.log.dead_reckoned(), "wheels", COLOURS[1], 0.8, (0, (1, 1.5)))
        scans = Drawn(self.laser.path, "scans", COLOURS[2], 1.4)
        again = self.log.loop_step - self.log.loop_to > 1
        loops = np.column_stack((self.log.loop_step, self.log.loop_to))[again]
        caption = (
            "From the prior's pose (dot). The laser's front end goes by scans together with wheels; a thin line is a "
            "motion by the scans alone, or a loop closure."
        )
        seen = [one for one in super().figures() if one.title != BY_ODOMETRY]
        return [path_figure(self, "Paths", caption, wheels, scans, loops=loops), *seen]

    def shown(self, folder: Path) -> Mapping[str, Any]:
        """Writes the camera's own files, and the map along the path of the laser's front end."""
        return {**super().shown(folder), **self.laser.shown(folder)}


def detect(opened: OpenedSeveral, request: Request, advance: Callable[[int], None]) -> SeveralFindings:
    """Makes the log of a recording's frames and scans, and its report; `advance` is called at every frame.

    InputError as of the front ends for either, where something cannot be written, and for a remark if strict.
    """
    recording, frames, made = opened.recording, opened.frames, list[Built]()

    def make(some: Recording, observe: Observe) -> Log:
        made.append(build(recording._replace(frames=some), observe, until_last_frame=request.seconds is not None))
        return finished(opened, made[-1].log)

    found = gathered(frames.recording, frames.truth, request, advance, make, frames.start_given)
    f, (built,) = found.findings, made
    path = compose(f.log.prior.pose, between(built.path[0], built.path))
    laser = LaserFindings(f.log, f.truth, f.seconds, built.scans, path)
    several = SeveralFindings(**{one.name: getattr(f, one.name) for one in fields(f)}, laser=laser)
    return replace(written(request, several), poses=found.write_poses())
