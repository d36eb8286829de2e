"""Makes an opened recording of markers with laser scans, depth frames or both into one log with one report."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...core.factors import Log
from ...core.se2 import between, compose
from ...datasets.recordings.several import OpenedSeveral, finished
from ...datasets.truth import with_truth
from ...frontend.depth.recording import DepthFrame
from ...frontend.markers.pipeline import Recording
from ...frontend.several.log import Built, build
from ...frontend.world.fixes import NOTE as FIXES
from ..drawing.figure import ReportFigure
from ..systematic.delays import told_delays
from ..words.numerals import counted, listed, number
from ..words.styles import COLOURS
from .findings import Findings
from .folder import Request, written
from .laser import LaserFindings, first_seconds
from .markers import MarkerFindings, Observe, gathered


@dataclass(frozen=True, eq=False)
class SeveralFindings(MarkerFindings):
    """The findings in frames, scans and depth frames."""

    template: ClassVar[str] = "detection_several.html.jinja"

    laser: LaserFindings | None = field(kw_only=True)  # of the same log; None without scans

    def headline(self) -> list[str]:
        """Summarises in sentences: the log and what is in it, then what the camera saw, then how others matched."""
        matched = [] if self.laser is None else self.laser.matched()
        return [_steps_and_motions(self, "Frames", self.laser), *super().headline(), *matched, *_used(self.log)]

    @property
    def depth(self) -> Mapping[str, Any] | None:
        """The counts of the depth camera's front end among the log's notes; None without one."""
        return self.log.notes.get("depth")

    def refused(self) -> str:
        """Lists what is left out of the log, and why searches for loops gave none, in a line."""
        return super().refused() if self.laser is None else f"{super().refused()} {self.laser.refused()}"

    def advice(self) -> list[str]:
        """Says what looks wrong, in sentences."""
        return [*super().advice(), *([] if self.laser is None else self.laser.advice())]

    def numbers(self) -> dict[str, Any]:
        """Returns the counts of frames and markers, and of scans and loops under `laser`, of depth frames likewise."""
        found = {**super().numbers(), "steps": len(self.log)}
        if self.laser is not None:
            own = {name: n for name, n in self.laser.numbers().items() if name not in ("seconds", "steps")}
            found["laser"] = {**own, "motions": self.laser.counts["motions"]}
        if self.depth is not None:
            found["depth"] = _of_depth(self.depth)
        return found

    def figures(self) -> list[ReportFigure]:
        """Draws the paths by wheels and by the laser's front end with its loop closures, and what the camera saw."""
        from .marker_figures import BY_ODOMETRY

        seen = [one for one in super().figures() if one.title != BY_ODOMETRY]
        return [_paths(self, self.laser), *seen]

    def shown(self, folder: Path) -> Mapping[str, Any]:
        """Writes the camera's own files, and the map along the path of the laser's front end."""
        return {**super().shown(folder), **({} if self.laser is None else self.laser.shown(folder))}


@dataclass(frozen=True, eq=False)
class ScansAndDepthFindings(LaserFindings):
    """The findings in scans and depth frames, without markers."""

    def headline(self) -> list[str]:
        """Summarises in sentences: the log and what is in it, then how scans matched."""
        return [_steps_and_motions(self, None, self), *self.matched(), *_used(self.log)]

    def numbers(self) -> dict[str, Any]:
        """Returns the counts of the scans, and those of depth frames under `depth`."""
        return {**super().numbers(), "motions": self.counts["motions"], "depth": _of_depth(self.log.notes["depth"])}

    def figures(self) -> list[ReportFigure]:
        """Draws the paths by wheels and by the laser's front end, with the motions by one sensor alone."""
        return [_paths(self, self)]


def _steps_and_motions(f: Findings, frames: str | None, laser: LaserFindings | None) -> str:
    """Says how many steps there are, and how many relative poses each sensor tells."""
    seen, motions, loops = [] if frames is None else [frames], 0, 0
    if laser is not None:
        seen.append(laser.scans)
        motions, loops = laser.counts["motions"], laser.loops
    if (depth := f.log.notes.get("depth")) is not None:
        seen.append(counted(depth["counts"]["frames"], "depth frame"))
        motions, loops = motions + depth["motions"], loops + depth["loops"]["in_log"]
    by = " and ".join(name for name, one in (("scans", laser), ("depth frames", depth)) if one is not None)
    return (
        f"{listed(seen)} in {number(f.seconds)} s: {counted(len(f.log), 'step')} over {number(f.way)} m, "
        f"{counted(motions, 'motion')} by the {by} alone, {counted(loops, 'loop closure')}."
    )


def _used(log: Log) -> list[str]:
    """Says which sensors the log is made of, and what each of its factors has."""
    laser, depth = log.notes.get("laser"), log.notes.get("depth")
    parts = [f"{counted(len(log.ids), 'sighting')} of markers"] if "markers" in log.notes else []
    parts.append(
        "motions that nothing measured" if "drift" in log.notes else f"{counted(len(log) - 1, 'motion')} by wheels"
    )
    if laser is not None:
        parts.append(f"{laser['motions'] + laser['loops']:,} relative poses by the laser")
    if depth is not None:
        parts.append(f"{depth['motions'] + depth['loops']['in_log']:,} by depth frames")
    if log.gyro is not None:
        parts.append(f"{counted(len(log.gyro), 'turn')} by the gyro")
    if (fixes := log.notes.get(FIXES)) is not None:
        named = (("positions", "position", "GPS"), ("headings", "heading", "the compass"))
        parts += [f"{counted(fixes[key], noun)} by {by}" for key, noun, by in named if fixes[key]]
    said = f"In the log: {listed(parts)}; each measurement is in one of them."
    return [said, *(one.sentence for one in told_delays(log))]


def _of_depth(depth: Mapping[str, Any]) -> dict[str, int]:
    """The numbers of depth frames, and of what they tell."""
    counts = {"frames": depth["counts"]["frames"], "steps": depth["steps"]}
    return {**counts, "motions": depth["motions"], "loops": depth["loops"]["in_log"]}


def _paths(f: Findings, laser: LaserFindings | None) -> ReportFigure:
    """Draws the paths by wheels and by the laser's front end, if any, with the relative poses."""
    from .figures import Path as Drawn
    from .figures import path_figure

    wheels = Drawn(f.log.dead_reckoned(), "wheels", COLOURS[1], 0.8, (0, (1, 1.5)))
    others = [] if laser is None else [Drawn(laser.path, "scans", COLOURS[2], 1.4)]
    again = f.log.loop_step - f.log.loop_to > 1
    loops = np.column_stack((f.log.loop_step, f.log.loop_to))[again]
    start = "" if laser is None else "The laser's front end goes by scans together with wheels; a "
    caption = (
        f"From the prior's pose (dot). {start or 'A '}thin line is a motion by one sensor alone, or a loop closure."
    )
    return path_figure(f, "Paths", caption, wheels, *others, loops=loops)


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
    laser = None if built.scans is None else LaserFindings(f.log, f.truth, f.seconds, built.scans, path)
    several = SeveralFindings(**{one.name: getattr(f, one.name) for one in fields(f)}, laser=laser)
    return replace(written(request, several), poses=found.write_poses())


def detect_unmarked(opened: OpenedSeveral, request: Request, advance: Callable[[int], None]) -> ScansAndDepthFindings:
    """Makes the log of a recording's scans and depth frames, and its report; `advance` is called at every depth frame.

    InputError as in `detect`.
    """
    recording, frames = opened.recording, opened.frames
    scans, depth, seconds = recording.scans, recording.depth, request.seconds
    assert scans is not None
    assert depth is not None
    if seconds is not None:
        recording = recording._replace(scans=first_seconds(scans, seconds))

    def counted_frames() -> Iterator[DepthFrame]:
        for frame in depth.frames:
            yield frame
            advance(0)

    recording = recording._replace(depth=replace(depth, frames=counted_frames()))
    built = build(recording, until_last_frame=seconds is not None)
    log, truth = with_truth(finished(opened, built.log), frames.truth, 0, frames.start_given)
    assert built.scans is not None
    path = compose(log.prior.pose, between(built.path[0], built.path))
    return written(request, ScansAndDepthFindings(log, truth, float(log.t[-1] - log.t[0]), built.scans, path))
