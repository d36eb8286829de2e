"""Makes an opened recording of a depth camera into a log with a report: `bench detect` of one."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.se2 import compose
from ...datasets.depth.open import OpenedDepth
from ...datasets.formats import log_folder
from ...datasets.remarks import refuse
from ...datasets.truth import with_truth
from ...frontend.depth.front_end import FrontEnd
from ...frontend.depth.level import tilt_of
from ...frontend.depth.log import log_of, looked_at
from ...frontend.depth.recording import DepthFrame
from ..camera.folder import write_folder
from ..camera.preview import Preview
from .annotate import annotated
from .findings import DepthFindings, Levels
from .page import write_page


class DepthRequest(NamedTuple):
    """The options of a detection."""

    source: str  # the recording, as the user named it
    out: Path
    preview: Preview | None = None
    seconds: float | None = None  # of the recording, at most
    strict: bool = False  # a log with a remark is refused


def detect(opened: OpenedDepth, request: DepthRequest, advance: Callable[[int], None]) -> DepthFindings:
    """Takes the front end through a recording and writes its log, clouds and report to `request.out`.

    `advance` is called at every frame with the number of steps so far. InputError where there are not two steps, where
    something cannot be written, and for a remark if strict.
    """
    recording, times = opened.recording, list[float]()
    if request.seconds is not None:
        recording = replace(recording, frames=FirstSeconds(recording.frames, request.seconds))

    def observe(front_end: FrontEnd) -> None:
        assert front_end.seen is not None  # there was a frame
        times.append(front_end.seen.frame.seconds)
        if request.preview is not None:
            request.preview.add(times[-1], annotated(front_end.seen, recording.camera))
        advance(len(front_end.steps))

    with request.preview or nullcontext():
        front_end = looked_at(recording, opened.settings, observe)
        log = log_of(recording, front_end)
    log, truth = with_truth(log, opened.truth)
    tilts = np.array([tilt_of(step.level, recording.camera) for step in front_end.steps])
    levels = Levels(tilts, np.array([step.level.found for step in front_end.steps]))
    loops = np.array([(loop.step, loop.to) for loop in front_end.loops], np.int64).reshape(-1, 2)
    path = compose(log.prior.pose, front_end.path)
    findings = DepthFindings(log, truth, recording, path, levels, loops, (times[0], times[-1]))
    if request.strict:
        refuse(request.source, findings.remarks)

    def write(folder: Path) -> None:
        log_folder.write(folder, findings.log, findings.truth)
        write_page(folder, request.out, findings)

    write_folder(request.out, write)
    return findings


@dataclass(frozen=True)
class FirstSeconds:
    """The frames of a recording's first `seconds`, any number of times."""

    frames: Iterable[DepthFrame]
    seconds: float

    def __iter__(self) -> Iterator[DepthFrame]:
        start = None
        for frame in self.frames:
            start = frame.seconds if start is None else start
            if frame.seconds - start > self.seconds:
                return
            yield frame
