"""Makes an opened recording into a log with a report: what `bench detect` does."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from ...core.factors import Log, Truth
from ...datasets.formats import log_folder
from ...datasets.remarks import refuse
from ...datasets.truth import with_truth
from ...frontend.markers.aruco import Sighting
from ...frontend.markers.diagnosis import diagnose, plausible_length
from ...frontend.markers.pipeline import Frame, FrameSightings, Recording, build_log
from .annotate import annotated
from .figures import range_bins
from .folder import write_detection_report, write_folder
from .kept_frames import ContactSheet, EmptyFrames
from .noise_calibration import CORNERS, calibrate, known_in_log, range_table, toml
from .preview import Preview
from .sightings import Detection, true_errors
from .summary import Findings, hardly_any

NOISE = "noise.toml"

JUDGED = 1000  # number of first sightings by which the markers' stated side is checked


class DetectRequest(NamedTuple):
    """The options of a detection."""

    source: str  # the recording, as the user named it
    out: Path
    preview: Preview | None = None
    seconds: float | None = None  # of the recording, at most
    calibrate_noise: bool = False
    strict: bool = False  # a log with a remark is refused


def detect(
    recording: Recording, truth: Truth | None, request: DetectRequest, advance: Callable[[int], None]
) -> Findings:
    """Detects the markers of a recording and writes its log and report to `request.out`.

    `advance` is called at every frame with the number of markers found so far. InputError where no frame can be used,
    where the noise is to be calibrated without a truth, where something cannot be written, and for a remark if strict.
    """
    if request.calibrate_noise and (truth is None or truth.map is None or not len(truth.t)):
        raise InputError(
            f"{request.source}: has no truth for --calibrate-noise, expected the robot's poses (truth.tum) and the "
            "markers' places (landmarks.csv) in its folder."
        )
    first: list[Sighting] = []
    detection, contact, empty = Detection(CORNERS if request.calibrate_noise else None), ContactSheet(), EmptyFrames()

    def observe(seen: FrameSightings) -> None:
        detection.observe(seen, recording.detector.camera.mounting)
        contact.observe(seen)
        empty.observe(seen)
        first.extend(seen.sightings[: JUDGED - len(first)])
        if request.preview is not None:
            request.preview.add(seen.frame.t, annotated(seen))

    def counted(frames: Iterable[Frame]) -> Iterator[Frame]:
        start = None
        for frame in frames:
            start = frame.t if start is None else start
            if request.seconds is not None and frame.t - start > request.seconds:
                return
            yield frame
            advance(detection.found)

    with request.preview or nullcontext():
        log = build_log(replace(recording, frames=counted(recording.frames)), observe)
    camera, markers = recording.detector.camera, recording.detector.markers
    advice = [plausible_length(first, markers)]
    advice += diagnose(empty.images, markers, camera) if hardly_any(detection) else []
    sentences = [
        f"{one[:1].upper()}{one[1:].rstrip('.')}{'' if one.endswith('?') else '.'}" for one in advice if one is not None
    ]
    findings = _findings(recording, log, truth, detection, sentences, request)

    if request.strict:
        refuse(request.source, findings.remarks)

    def write(folder: Path) -> None:
        log_folder.write(folder, findings.log, findings.truth)
        if findings.calibration is not None:
            (folder / NOISE).write_text(toml(findings.calibration), encoding="utf-8")
        write_detection_report(folder, request.out, findings, contact.pictures())

    write_folder(request.out, write)
    return findings


def _findings(
    recording: Recording, log: Log, truth: Truth | None, detection: Detection, advice: list[str], request: DetectRequest
) -> Findings:
    log, known = with_truth(log, truth)
    sightings = detection.sightings()
    true = None if known is None else true_errors(sightings, log.t, known)
    calibration, bins = None, []
    if true is not None and len(true.errors):
        seen, errors = known_in_log(sightings, true)
        bins = range_table(seen.z, errors, [seen.cov], range_bins(seen.z[:, 0]))
    if true is not None and request.calibrate_noise:
        calibration = calibrate(sightings, true, range_bins(sightings.z[sightings.kept, 0]))
    return Findings(
        log, known, recording.max_range, detection.size, detection.t, sightings, true, bins, advice, calibration
    )
