"""Makes an opened recording of laser scans into a log with a report: `bench detect` of scans."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, between, compose
from ...datasets.fixes.open import in_world
from ...datasets.formats.relations import build
from ...datasets.inertial.open import beside
from ...datasets.scans.open import OpenedScans
from ...datasets.truth import with_truth
from ...frontend.laser.front_end import FrontEnd
from ...frontend.laser.recording import LaserRecording
from ...frontend.maps.occupancy import occupancy
from ..drawing.figure import ReportFigure
from ..drawing.map_picture import CELL, MOST, map_picture
from ..words.numerals import counted, number
from ..words.styles import COLOURS
from .findings import Findings, by_count, told
from .folder import Request, written
from .page import write_map

MANY_LOST = 0.1  # share of lost scans from which on something must be wrong


@dataclass(frozen=True, eq=False)
class LaserFindings(Findings):
    """The findings in laser scans."""

    template: ClassVar[str] = "detection_laser.html.jinja"

    recording: LaserRecording
    path: Array  # (k, 3) the front end's own estimate of the steps

    @property
    def counts(self) -> Mapping[str, Any]:
        """The front end's counts, as the log's notes have them."""
        return self.log.notes["laser"]

    @property
    def loops(self) -> int:
        """The number of loop closures."""
        return self.counts.get("loops", len(self.log.loop_to))

    @property
    def turned_down(self) -> list[tuple[str, int]]:
        """Lists why searches gave no loop, and how often."""
        return by_count(self.counts["turned_down"])

    def headline(self) -> list[str]:
        """Summarises in sentences: scans and steps, lost scans, loops."""
        wheels = "with wheels" if self.counts["wheels"] else "without wheels"
        steps, loops = counted(len(self.log), "step"), counted(self.loops, "loop closure")
        said = f"{self.scans} in {number(self.seconds)} s, {wheels}: {steps} over {number(self.way)} m, {loops}."
        return [said, *self.matched()]

    @property
    def scans(self) -> str:
        """Counts scans and beams."""
        least, most = self.recording.beams
        beams = f"{least:,} to " * (least < most) + counted(most, "beam")
        return f"{counted(len(self.recording.t), 'scan')} of {beams}"

    def matched(self) -> list[str]:
        """Says in sentences how scans matched, and what became of searches for loops."""
        n, c, said = len(self.recording.t), self.counts, list[str]()
        loops = counted(self.loops, "loop closure")
        if c["lost"]:
            said.append(
                f"{counted(c['lost'], 'scan')} did not match the last metres ({100 * c['lost'] / n:.2g} %); the search "
                f"placed {c['relocated']:,} of them elsewhere."
            )
        else:
            said.append("Every scan matched the last metres.")
        if c["doubted"]:
            stay = f"{c['undecided']:,} {'stay' if c['undecided'] > 1 else 'stays'} undecided"
            left = stay if c["undecided"] else "later scans decided"
            said.append(f"{counted(c['doubted'], 'time')} wheels and scans gave more than one place: {left}.")
        if c["by_wheels"]:
            said.append(
                f"{counted(c['by_wheels'], 'scan')} were placed by the wheels: what they were matched to moved along "
                "with the robot."
            )
        if c["searched"]:
            far = f", {c['confirmed']:,} of them far from the estimate and confirmed," if c["confirmed"] else ""
            said.append(
                f"Steps were searched for in earlier submaps {c['searched']:,} times: {loops}{far} and "
                f"{sum(n for _, n in self.turned_down):,} turned down."
            )
        elif c["settings"]["loops"]:
            said.append("The robot never came back to where it had been, so no loop was searched for.")
        return said

    def refused(self) -> str:
        """Lists why searches gave no loop in a line."""
        return f"Turned down: {told([f'{n:,} ({why})' for why, n in self.turned_down])}."

    def advice(self) -> list[str]:
        """Says what looks wrong, in sentences."""
        n, lost = len(self.recording.t), self.counts["lost"]
        if lost <= MANY_LOST * n:
            return []
        least, most, ranges = self.recording.scanner.least, self.recording.scanner.most, self.recording.ranges
        returns = float(((ranges > least) & (ranges < most)).mean())
        beams = f"{100 * returns:.0f} % of the beams are returns between {least:g} and {most:g} m"
        causes = "perhaps the scanner's pose on the robot, these limits or the odometry's clock are wrong"
        return [f"{100 * lost / n:.0f} % of the scans did not match, and {beams}: {causes}."]

    def numbers(self) -> dict[str, Any]:
        """Returns the counts of scans, steps, loops and searches."""
        return {
            "scans": len(self.recording.t),
            "beams": self.recording.beams[1],
            "seconds": self.seconds,
            "wheels": self.counts["wheels"],
            "steps": len(self.log),
            "loops": self.loops,
            **{
                name: self.counts[name]
                for name in (
                    "lost",
                    "relocated",
                    "doubted",
                    "undecided",
                    "by_wheels",
                    "submaps",
                    "searched",
                    "confirmed",
                )
            },
            "turned_down": dict(self.turned_down),
        }

    def figures(self) -> list[ReportFigure]:
        """Draws the paths by wheels, by matched scans and with loops, and the loop closures."""
        from .figures import Path, again_figure, path_figure

        wheels, paths = self.recording.odometry, list[Path]()
        if wheels is not None:
            walked = compose(self.log.prior.pose, between(wheels[0], wheels))
            paths.append(Path(walked, "wheels", COLOURS[1], 0.8, (0, (1, 1.5))))
        paths.append(Path(self.log.dead_reckoned(), "matched scans", COLOURS[0], 1.0, (0, (4, 1.5))))
        paths.append(Path(self.path, "with loops", COLOURS[2], 1.4))
        loops = np.column_stack((self.log.loop_step, self.log.loop_to))
        caption = (
            "From the prior's pose (dot). The front end's own pose graph gives the path with loops; a loop is a thin "
            "line."
        )
        drawn = [path_figure(self, "Paths", caption, *paths, loops=loops)]
        if len(loops):
            caption = "Each dot is one; a line of them is a stretch driven again."
            drawn.append(again_figure(self, loops, "Loop closures", caption, "leads back to step"))
        return drawn

    def shown(self, folder: Path) -> Mapping[str, Any]:
        """Writes the map along the front end's own path."""
        assert self.log.scans is not None  # the laser front end keeps them
        return write_map(folder, map_picture(occupancy(self.log.scans, self.path, CELL, MOST), self.path))


def detect(opened: OpenedScans, request: Request, advance: Callable[[int], None]) -> LaserFindings:
    """Matches the scans of a recording and writes its log, scans and report.

    `advance` is called at every scan with the number of loop closures so far. InputError where there are not two steps,
    where something cannot be written, and for a remark if strict.
    """
    if opened.settings.grid is not None:
        raise InputError(
            f"{request.source}: [laser] grid in robot.toml localises on a map, and bench detect makes one; expected it "
            "without grid. bench run --dataset takes the recording as it is."
        )
    recording = opened.recording if request.seconds is None else first_seconds(opened.recording, request.seconds)

    def observe(front_end: FrontEnd) -> None:
        advance(len(front_end.loops))

    made = build(recording, opened.settings, opened.file, opened.remarks, observe)
    log, truth = in_world(beside(made.dataset.log, opened.inertial), opened.world), made.dataset.truth
    if opened.truth is not None:
        log, truth = with_truth(log, opened.truth, start_given=opened.start_given)
    estimate = np.array(made.front_end.estimate)
    path = compose(log.prior.pose, between(estimate[0], estimate))
    return written(request, LaserFindings(log, truth, float(recording.t[-1] - recording.t[0]), recording, path))


def first_seconds(recording: LaserRecording, seconds: float) -> LaserRecording:
    """The recording's scans of its first `seconds`."""
    return recording.taken(recording.t - recording.t[0] <= seconds)
