"""Makes an opened recording of laser scans into a log with a report: `bench detect` of scans."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import between, compose
from ...datasets.formats import log_folder
from ...datasets.formats.relations import build
from ...datasets.remarks import refuse
from ...datasets.scans.open import OpenedScans
from ...datasets.truth import with_truth
from ...frontend.laser.front_end import FrontEnd
from ...frontend.laser.recording import LaserRecording
from ..camera.folder import write_folder
from .findings import LaserFindings
from .page import write_page


class LaserRequest(NamedTuple):
    """The options of a detection."""

    source: str  # the recording, as the user named it
    out: Path
    seconds: float | None = None  # of the recording, at most
    strict: bool = False  # a log with a remark is refused


def detect(opened: OpenedScans, request: LaserRequest, advance: Callable[[int], None]) -> LaserFindings:
    """Matches the scans of a recording and writes its log, scans and report to `request.out`.

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
    log, truth = made.dataset if opened.truth is None else with_truth(made.dataset.log, opened.truth)
    estimate = np.array(made.front_end.estimate)
    path = compose(recording.prior.pose, between(estimate[0], estimate))
    findings = LaserFindings(log, truth, recording, path)
    if request.strict:
        refuse(request.source, findings.remarks)

    def write(folder: Path) -> None:
        log_folder.write(folder, findings.log, findings.truth)
        write_page(folder, request.out, findings)

    write_folder(request.out, write)
    return findings


def first_seconds(recording: LaserRecording, seconds: float) -> LaserRecording:
    """The recording's scans of its first `seconds`."""
    rows = recording.t - recording.t[0] <= seconds
    odometry = None if recording.odometry is None else recording.odometry[rows]
    return replace(recording, t=recording.t[rows], ranges=recording.ranges[rows], odometry=odometry)
