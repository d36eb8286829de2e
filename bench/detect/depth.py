"""Makes an opened recording of a depth camera into a log with a report: `bench detect` of one."""

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.beside import Clouds
from ...core.se2 import Array, Ints, compose
from ...datasets.depth.open import OpenedDepth, finished
from ...datasets.truth import with_truth
from ...frontend.depth.front_end import FrontEnd
from ...frontend.depth.level import tilt_of
from ...frontend.depth.log import log_of, looked_at
from ...frontend.depth.recording import DepthRecording
from ...frontend.maps.obstacles import HIGH
from ...frontend.maps.top_view import top_view
from ..drawing.figure import ReportFigure
from ..drawing.map_picture import CELL, MOST, map_picture
from ..words.numerals import counted, number
from ..words.styles import COLOURS
from .depth_frames import annotated
from .findings import Findings, by_count, told
from .folder import Request, written
from .page import write_map

MANY = 0.5
"""Share of the keyframes without a floor, or of pairs turned down, from which on something must be wrong."""

TILTED = 0.05  # rad; a mean attitude from which on the stated mounting is doubted
OFF = 0.05  # m; likewise the height of the robot's origin above the floor
FEW = 50  # features of a keyframe, on average, below which there is little to see
WIDE = 800  # px that a small map is enlarged to


class Levels(NamedTuple):
    """The body's attitude at every step."""

    tilts: Array  # (k, 3) pitch forward and roll to the right (rad), and the origin's height above the floor (m)
    found: NDArray[np.bool]  # (k,) False: no floor was found, and the mounting is taken as stated


@dataclass(frozen=True, eq=False)
class DepthFindings(Findings):
    """The findings in a depth camera's frames."""

    template: ClassVar[str] = "detection_depth.html.jinja"

    recording: DepthRecording
    path: Array  # (k, 3) the front end's own estimate of the steps
    levels: Levels
    again: Ints  # (l, 2) steps, and earlier ones whose places they show

    @property
    def notes(self) -> Mapping[str, Any]:
        """The front end's settings, places and refusals, as the log's notes have them."""
        return self.log.notes["depth"]

    @property
    def counts(self) -> Counter[str]:
        """The front end's counts of frames, features and pairs."""
        return Counter(self.notes["counts"])

    @property
    def clouds(self) -> Clouds:
        """The clouds beside the log."""
        assert self.log.clouds is not None  # the front end for depth cameras keeps them
        return self.log.clouds

    @property
    def size(self) -> str:
        """The size of the images, px."""
        return f"{self.recording.camera.width}x{self.recording.camera.height}"

    @property
    def turned_down(self) -> list[tuple[str, int]]:
        """Lists why pairs of keyframes were not registered, and how often."""
        return by_count(self.notes["turned_down"])

    @property
    def places_turned_down(self) -> list[tuple[str, int]]:
        """Lists why earlier places were not recognised, likewise."""
        return by_count(self.notes["loops"]["turned_down"])

    @property
    def left_out(self) -> list[tuple[str, int]]:
        """Lists frames of the recording that were left out, likewise: those that are bad or without odometry."""
        without = {name for name in self.counts if name.startswith("frames without ")} - {"frames without a floor"}
        return by_count({name: n for name, n in self.counts.items() if name in without | {*self.recording.left_out}})

    def headline(self) -> list[str]:
        """Summarises in sentences: frames, steps and factors; pairs, levelling, places seen again."""
        c, searched, n = self.counts, self.notes["loops"]["searched"], len(self.log)
        wheels = "with wheels" if self.recording.motion is not None else "without wheels"
        seen = counted(len(self.log.loop_to), "loop closure")
        if self.notes["settings"]["landmarks"]:
            landmarks = counted(len(np.unique(self.log.ids)), "landmark")
            seen = f"{counted(len(self.log.ids), 'sighting')} of {landmarks}"
        length, steps = number(self.seconds), f"{counted(n, 'step')} over {number(self.way)} m"
        said = [f"{counted(c['frames'], 'frame')} of {self.size} pixels in {length} s, {wheels}: {steps}, {seen}."]
        if c["pairs"]:
            said.append(f"{c['pairs registered']:,} of {counted(c['pairs'], 'pair')} of keyframes were registered.")
        lost = int((~self.levels.found).sum())
        if lost == n:
            said.append("No step is levelled by a floor: pitch, roll and height are those of the stated mounting.")
        elif lost:
            share = f"{lost:,} ({100 * lost / n:.2g} %)"
            levelled = counted(n - lost, "step")
            said.append(f"The floor levels {levelled}; {share} show no floor and are taken as the mounting states.")
        else:
            said.append("The floor levels every step.")
        if searched:
            again = counted(len(self.again), "time")
            said.append(f"Earlier places were compared {counted(searched, 'time')} and recognised {again}.")
        return said

    def refused(self) -> str:
        """Lists the refused pairs and the frames left out in a line."""
        pairs = told([f"{n:,} ({why})" for why, n in self.turned_down])
        return f"Turned down: {pairs}. Left out: {told([f'{n:,} {why}' for why, n in self.left_out])}."

    def advice(self) -> list[str]:
        """Says what looks wrong, in sentences."""
        c, said, found = self.counts, list[str](), self.levels.found
        looked, pairs = c["frames looked at"], c["pairs"]
        if self.notes["settings"]["level"] and (~found).mean() > MANY:
            said.append(
                f"{100 * (~found).mean():.0f} % of the steps show no floor: perhaps [camera] mounting is wrong, or the "
                "camera looks above it."
            )
        elif found.any():
            pitch, roll, up = self.levels.tilts[found].mean(axis=0).tolist()
            if max(abs(pitch), abs(roll)) > TILTED or abs(up) > OFF:
                said.append(
                    f"On average the floor has the body pitched by {np.degrees(pitch):.1f} degrees, rolled by "
                    f"{np.degrees(roll):.1f} and {100 * up:.0f} cm above where the mounting has it: perhaps [camera] "
                    "mounting is wrong."
                )
        if c["features"] < FEW * looked:
            said.append(
                f"A keyframe has {c['features'] / looked:.0f} features with depth, expected hundreds: perhaps the "
                f"depth is not registered, near and far leave it out{self._median}, or there is little texture."
            )
        refused = dict(self.turned_down).get("it contradicts the wheels", 0)
        if pairs and refused > MANY * pairs:
            said.append(
                f"{100 * refused / pairs:.0f} % of the pairs contradict the wheels: perhaps the images' clock "
                "(time_offset), the odometry's noise or the calibration is wrong."
            )
        elif pairs and c["pairs registered"] < (1 - MANY) * pairs:
            said.append(
                f"{100 * (1 - c['pairs registered'] / pairs):.0f} % of the pairs of keyframes were turned down."
            )
        return [*said, *self.motions_by_truth()]

    @property
    def _median(self) -> str:
        """The median depth, in the middle of a sentence; nothing in a log without it."""
        median = self.notes.get("median")
        return "" if median is None else f" (the median depth is {number(median)} m: [depth] units)"

    def numbers(self) -> dict[str, Any]:
        """Returns the counts of frames, features, steps, pairs and places."""
        c, found = self.counts, self.levels.found
        tilts = self.levels.tilts[found]
        return {
            "frames": c["frames"],
            "width": self.recording.camera.width,
            "height": self.recording.camera.height,
            "seconds": self.seconds,
            "wheels": self.recording.motion is not None,
            "keyframes": c["frames looked at"],
            "features": c["features"],
            "steps": len(self.log),
            "landmarks": len(np.unique(self.log.ids)),
            "sightings": len(self.log.ids),
            "loops": len(self.log.loop_to),
            "pairs": c["pairs"],
            "pairs_registered": c["pairs registered"],
            "turned_down": dict(self.turned_down),
            "places_compared": self.notes["loops"]["searched"],
            "places_recognised": len(self.again),
            "places_turned_down": dict(self.places_turned_down),
            "steps_without_floor": int((~found).sum()),
            "pitch_roll_sd": tilts[:, :2].std(axis=0).tolist() if len(tilts) else None,
            "left_out": dict(self.left_out),
            "points": len(self.clouds.points),
        }

    def figures(self) -> list[ReportFigure]:
        """Draws paths, levelling, and places seen again."""
        from .figures import Path, again_figure, path_figure, time_figure

        t, (tilts, found) = self.log.t, self.levels
        source = "wheels" if self.notes["settings"]["odometry"] == "wheels" else "frame to frame"
        caption = "From the prior's pose (dot)."
        if len(self.again):
            caption += (
                " The front end's own path takes the shortcut over an earlier place wherever that is surer than the "
                "way since; thin lines lead there. Backends make more of the log."
            )
        reckoned = Path(self.log.dead_reckoned(), source, COLOURS[1], 0.9, (0, (1, 1.5)))
        own = Path(self.path, "front end", COLOURS[2], 1.4)
        drawn = [path_figure(self, "Paths", caption, reckoned, own, loops=self.again)]
        pitch, roll = np.degrees(tilts[:, :2].T)
        angles = {"forward": pitch, "to the right": roll}
        caption = "The body by the floor in each depth image, against the stated mounting."
        drawn.append(time_figure(t, angles, found, "no floor", "Levelling: pitch and roll", caption, "degrees"))
        caption = "The robot's origin above the floor by each depth image: 0 where the stated mounting has it."
        height = {"": 1000 * tilts[:, 2]}
        drawn.append(time_figure(t, height, found, "no floor", "Levelling: height", caption, "height, mm"))
        if len(self.again):
            ids = "At each dot features got back their earlier ids."
            caption = "Each dot is a loop closure." if len(self.log.loop_to) else ids
            drawn.append(again_figure(self, self.again, "Places seen again", caption, "shows the place of step"))
        return drawn

    def shown(self, folder: Path) -> Mapping[str, Any]:
        """Writes the map from above along the front end's own path."""
        view = top_view(self.clouds, self.path, CELL, MOST)
        picture = map_picture(view, self.path, max(1, WIDE // max(view.colours.shape)))
        return write_map(folder, picture) | {"cell": view.size, "high": HIGH}


def detect(opened: OpenedDepth, request: Request, advance: Callable[[int], None]) -> DepthFindings:
    """Takes the front end through a recording and writes its log, clouds and report.

    `advance` is called at every frame with the number of steps so far. InputError where there are not two steps, where
    something cannot be written, and for a remark if strict.
    """
    recording, times = opened.recording, list[float]()
    first = request.first(recording.frames, lambda frame: frame.seconds)

    def observe(front_end: FrontEnd) -> None:
        assert front_end.seen is not None  # there was a frame
        times.append(front_end.seen.frame.seconds)
        if request.preview is not None:
            request.preview.add(times[-1], annotated(front_end.seen, recording.camera))
        advance(len(front_end.steps))

    with request.preview or nullcontext():
        front_end = looked_at(replace(recording, frames=first), opened.settings, observe)
        made = finished(opened, log_of(recording, front_end))
        log, truth = with_truth(made, opened.truth, start_given=opened.start_given)
    tilts = np.array([tilt_of(step.level, recording.camera) for step in front_end.steps])
    levels = Levels(tilts, np.array([step.level.found for step in front_end.steps]))
    again = np.array([(loop.step, loop.to) for loop in front_end.loops], np.int64).reshape(-1, 2)
    path = compose(log.prior.pose, front_end.path)
    return written(request, DepthFindings(log, truth, times[-1] - times[0], recording, path, levels, again))
