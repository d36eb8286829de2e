"""Makes an opened recording of markers into a log with a report: `bench detect` of a camera's frames."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Log, Truth
from ...core.se2 import Array
from ...core.truth.doubts import headings_known
from ...datasets.truth import with_truth
from ...frontend.markers.aruco import Sighting
from ...frontend.markers.diagnosis import diagnose, plausible_length
from ...frontend.markers.pipeline import Frame, FrameSightings, Recording, build_log
from ..drawing.figure import ReportFigure
from ..words.numerals import counted, listed, number
from .findings import Findings, told
from .folder import Request, written
from .kept_frames import ContactSheet, EmptyFrames, Picture, sheet
from .marker_frames import annotated
from .noise_calibration import CONSISTENT, CORNERS, Calibration, RangeBin, calibrate, errors_by_range, toml
from .page import NOISE, SHEET
from .pictures import encoded
from .sightings import Detection, Marker, OfCamera, Sightings, TrueErrors, in_log, markers, per_frame, true_errors
from .tag_files import TagFile

JUDGED = 1000  # number of first sightings by which the markers' stated side is checked
NOISES = ("stated", "proportional", "propagated")  # in the order of RangeBin.nees; the last two if fitted
UNLEVELLED = (
    "to calibrate the noise, sightings are not levelled by gravity, as sway is of the body; run again without "
    "--calibrate-noise for the levelled log"
)

HARDLY = 0.05  # share of frames with a marker below which the causes are diagnosed


@dataclass(frozen=True, eq=False)
class MarkerFindings(Findings):
    """The findings in a camera's frames."""

    template: ClassVar[str] = "detection_markers.html.jinja"

    max_range: float  # m; infinite: none
    reach: str  # from where on a sighting is too far, in words
    t: Array  # (n,) s, of the frames
    cameras: Mapping[str, OfCamera]  # by name; "": the only one
    sightings: Sightings
    true: TrueErrors | None
    bins: Sequence[RangeBin]  # of the sightings with known errors
    calibration: Calibration | None
    causes: Sequence[str]  # why so little was detected, and what else looks wrong
    pictures: Sequence[Picture]
    poses: Sequence[Path] = ()  # the files of the tags' poses

    @property
    def tested(self) -> Sequence[RangeBin]:
        """The errors by range: by the fitted models too, if there are any."""
        return self.calibration.bins if self.calibration else self.bins

    @property
    def left_out(self) -> list[tuple[str, int]]:
        """Lists what is in the recording and not in the log, with reasons and counts; frames first."""
        counts: Mapping[str, int] = self.log.notes["counts"]
        other = [(name, n) for name, n in counts.items() if n and name not in ("frames", "sightings")]
        return sorted(other, key=lambda one: not one[0].startswith("frames "))

    @property
    def markers(self) -> list[Marker]:
        """Lists the markers in the log."""
        return list(markers(in_log(self.sightings), self.t))

    @property
    def printed(self) -> str:
        """Describes the markers as far as that is known."""
        told = self.log.notes["markers"]
        named = [f"dictionary {told['dictionary']}"] if "dictionary" in told else []
        named += [f"side {told['side']:g} m"] if "side" in told else []
        return ", ".join(named) or "markers of poses alone"

    def headline(self) -> list[str]:
        """Summarises in sentences: detections first, then their quality."""
        kept, frames = in_log(self.sightings), counted(len(self.t), "frame")
        if not len(kept.ids):
            return [f"No marker that can be used was found in {frames}."]
        found = f"{counted(len(kept.ids), 'sighting')} of {counted(len(np.unique(kept.ids)), 'marker')}"
        counts = per_frame(kept, len(self.t))
        none, mean = int((counts == 0).sum()), number(float(counts.mean()))
        fit = float(np.sqrt((kept.error**2).mean()))
        said = [f"{found} in {frames}, {mean} a frame; {none:,} saw none."]
        said += [self.by_camera()] if len(self.cameras) > 1 else []
        said += [] if np.isnan(fit) else [f"Corners fit to {number(fit)} px."]
        return [*said, _truthfulness(self.bins)] if self.bins else said

    def by_camera(self) -> str:
        """Counts the frames and sightings of each of several cameras."""
        cameras = self.cameras.items()
        of = [f"{counted(one.kept, 'sighting')} in {counted(one.frames, 'frame')} of {name}" for name, one in cameras]
        return f"Those are {listed(of)}."

    def refused(self) -> str:
        """Lists what is left out of the log in a line."""
        return f"Left out: {told([_left_out(name, n) for name, n in self.left_out])}."

    def advice(self) -> list[str]:
        """Says why so little was detected, and what else looks wrong."""
        said = [f"{one[:1].upper()}{one[1:].rstrip('.')}{'' if one.endswith('?') else '.'}" for one in self.causes]
        return [*said, *self.motions_by_truth()]

    def numbers(self) -> dict[str, Any]:
        """Returns the counts of frames, sightings and markers."""
        width, height = next(iter(self.cameras.values())).size
        several = {name: _numbers(one) for name, one in self.cameras.items()} if len(self.cameras) > 1 else {}
        return {
            "frames": len(self.t),
            "seconds": self.seconds,
            "width": width,
            "height": height,
            **({"cameras": several} if several else {}),
            "sightings": int(self.sightings.kept.sum()),
            "markers": [one._asdict() for one in self.markers],
            "left_out": dict(self.left_out),
        }

    def as_json(self, out: str) -> dict[str, Any]:
        """Returns the findings as JSON takes them, with the errors by range and the fitted noise."""
        by_range = [one._asdict() | {"nees": dict(zip(NOISES, one.nees, strict=False))} for one in self.tested]
        words = super().as_json(out) | {"by_range": by_range}
        if (c := self.calibration) is not None:
            words["noise"] = {
                "proportional": c.proportional.settings,
                "propagated": c.propagated.settings,
                "likelier": c.likelier,
                "standard_errors": {
                    "k_range": c.range.k_error,
                    "k_bearing": c.bearing.k_error,
                    "floor_range": c.range.floor_error,
                    "floor_bearing": c.bearing.floor_error,
                    "scale": c.corners.scale_error,
                    "sway": c.corners.sway_error,
                },
                "sightings": c.sightings,
            }
        return words

    def figures(self) -> list[ReportFigure]:
        """Draws sightings by range, time and place, their errors where any is known, and the path by odometry."""
        from .marker_figures import figures

        return figures(self)

    def shown(self, folder: Path) -> Mapping[str, Any]:
        """Writes the contact sheet, and the fitted noise for a robot.toml."""
        noise = toml(self.calibration) if self.calibration else ""
        if noise:
            (folder / NOISE).write_text(noise, encoding="utf-8")
        if self.pictures:
            (folder / SHEET).write_bytes(encoded(sheet(list(self.pictures)), ".png"))
        pictures = [(one, encoded(one.image, ".jpg")) for one in self.pictures]
        return {"pictures": pictures, "noise": noise, "consistent": CONSISTENT}


Observe = Callable[[FrameSightings], None]


class Gathered(NamedTuple):
    """The findings in a recording, and the file of the tags' poses that is still to be written, if one is wanted."""

    findings: MarkerFindings
    write_poses: Callable[[], Sequence[Path]]


def detect(
    recording: Recording,
    truth: Truth | None,
    request: Request,
    advance: Callable[[int], None],
    start_given: bool = True,
    finish: Callable[[Log], Log] | None = None,
) -> MarkerFindings:
    """Detects the markers of a recording and writes its log and report.

    Where the start was not given, the log begins at the truth's. `finish` adds what others measured. `advance` is
    called at every frame with the number of markers found so far. InputError where no frame can be used, where the
    noise is to be calibrated without a truth, where something cannot be written, and for a remark if strict.
    """

    def make(frames: Recording, observe: Observe) -> Log:
        log = build_log(frames, observe)
        return log if finish is None else finish(log)

    found = gathered(recording, truth, request, advance, make, start_given)
    written(request, found.findings)
    return replace(found.findings, poses=found.write_poses())


def gathered(
    recording: Recording,
    truth: Truth | None,
    request: Request,
    advance: Callable[[int], None],
    make: Callable[[Recording, Observe], Log],
    start_given: bool = True,
) -> Gathered:
    """Detects the markers of a recording while `make` makes its log; InputError as in `detect`."""
    if request.calibrate_noise and (truth is None or truth.map is None or not len(truth.t)):
        raise InputError(
            f"{request.source}: has no truth for --calibrate-noise, expected the robot's poses (truth.tum) and the "
            "markers' places (landmarks.csv) in its folder."
        )
    markers = recording.detector.markers
    cameras = {name: one.camera for name, one in recording.detectors.items()}
    first: list[Sighting] = []
    tags = None if request.poses is None else TagFile(request.poses)
    detection, contact = Detection(CORNERS if request.calibrate_noise else None), ContactSheet()
    empty = {name: EmptyFrames() for name in cameras}

    def observe(seen: FrameSightings) -> None:
        name = seen.frame.camera
        detection.observe(seen, cameras[name].mounting)
        contact.observe(seen)
        empty[name].observe(seen)
        first.extend(seen.sightings[: JUDGED - len(first)])
        if request.preview is not None and seen.frame.image is not None:
            request.preview.add(seen.frame.t, annotated(seen), name)
        if tags is not None:
            tags.observe(seen)

    def frames() -> Iterator[Frame]:
        for frame in request.first(recording.frames, lambda frame: frame.t):
            yield frame
            advance(detection.found)

    with request.preview or nullcontext():
        used = replace(recording, frames=frames())
        # What is calibrated is the body's own sway, and not what levels leave of it.
        made = make(replace(used, tilts=None) if request.calibrate_noise else used, observe)
        log, known = with_truth(made, truth, 0, start_given)
    sightings = detection.sightings()
    causes = [plausible_length(first, markers)]
    if request.calibrate_noise and recording.tilts is not None:
        causes.append(UNLEVELLED)
    for name, one in detection.cameras.items():
        if one.seeing < HARDLY * one.frames:
            found = diagnose(empty[name].images, markers, cameras[name])
            causes += [f"camera {name}: {cause}" if name else cause for cause in found]
    t = np.array(detection.times)
    true = None if known is None or not headings_known(log, known) else true_errors(sightings, t, known)
    findings = MarkerFindings(
        log,
        known,
        float(log.t[-1] - log.t[0]),
        max_range=recording.max_range,
        reach=recording.reach,
        t=t,
        cameras={name: detection.cameras.get(name, OfCamera()) for name in cameras},
        sightings=sightings,
        true=true,
        bins=[] if true is None else errors_by_range(sightings, true),
        calibration=None if true is None or not request.calibrate_noise else calibrate(sightings, true),
        causes=[one for one in causes if one is not None],
        pictures=contact.pictures(),
    )

    def write_poses() -> Sequence[Path]:
        return [] if tags is None else tags.write(log, {name: one.mounting for name, one in cameras.items()})

    return Gathered(findings, write_poses)


def _numbers(camera: OfCamera) -> dict[str, int]:
    width, height = camera.size
    return {"frames": camera.frames, "width": width, "height": height, "sightings": camera.kept}


def _truthfulness(bins: Sequence[RangeBin]) -> str:
    n = np.array([one.sightings for one in bins])
    nees = float(n @ [one.nees[0] for one in bins] / n.sum())
    bias = float(n @ [one.range_mean for one in bins] / n.sum())
    word = "cautious" if nees < CONSISTENT[0] else "consistent" if nees <= CONSISTENT[1] else "overconfident"
    return (
        f"Against the truth, ranges are {number(1e3 * abs(bias))} mm too {'long' if bias > 0 else 'short'} on average, "
        f"and the stated noise is {word}: NEES {number(nees)}, 1 being exact."
    )


def _left_out(name: str, n: int) -> str:
    noun, _, why = name.partition(" ")
    if noun in ("frames", "sightings"):
        return f"{counted(n, noun.removesuffix('s'))} {why}"
    return f"{counted(n, 'marker')} ({name})"
