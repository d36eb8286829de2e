"""Drives a backend through its log once more, in a process of its own, and asks for its map on the way.

Beside laser scans it also asks for the path so far, as a map is drawn along it. Only `finish` tells that, and a backend
ends there: so it is made again for each of these moments, and driven up to it.
"""

import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...backends import registry as backends
from ...backends.api import Backend, Calibrates, Constant, Diverged, Map, Solution, WantsTruth
from ...backends.given import given, refused
from ...backends.locating.locating import begin
from ...core.errors import SlamduelError
from ...core.factors import Log, Step
from ...core.se2 import Array, Ints
from ...datasets import archive
from ..measure import cell as cells

MAP_S = 20.0  # s of CPU time for all maps: a smoother's map is slow where there are thousands of steps


MOMENTS = 24  # frames at which a grid of laser scans is drawn, at most

REVISED_S = 20.0
"""s of CPU time for the paths at these moments; where a log takes longer, there are fewer of them."""


class ReplayTask(NamedTuple):
    """One backend on the log that is archived at a path."""

    job: cells.Job
    log: Path
    frames: Ints  # (f,) the steps at which it is asked, the last one among them


class Landmarks(NamedTuple):
    """A map without correlations between landmarks."""

    ids: Ints  # (n,)
    xy: Array  # (n, 2)
    cov: Array  # (n, 2, 2), NaN where not known


class Revised(NamedTuple):
    """The whole path so far, as it is estimated at a frame."""

    frame: int
    path: Array  # (k + 1, 3) up to the frame's step k


class Course(NamedTuple):
    """The course of a backend, as far as it got."""

    path: Array  # (m, 3) of the first m steps
    cov: Array  # (g, 3, 3) at the first g frames, NaN where not known
    maps: list[Landmarks]  # (g,)
    asked: int  # number of frames whose map was asked for; the others repeat the one before
    final: bool  # path and map are those of the end, there are no online ones
    ended: str  # why it stopped, "" where it reached the end
    revised: list[Revised]  # beside laser scans, of a backend that smooths its path; the last one is that of the end
    constant: Constant | None = None  # of ranges alone whose scale or offset all landmarks share, at the end


def moments(frames: int, count: int = MOMENTS) -> list[int]:
    """Returns at most `count` of so many frames, evenly spaced, the last one among them."""
    return np.unique(np.linspace(0, frames - 1, count + 1).round().astype(np.int64)[1:]).tolist()


def run(task: ReplayTask) -> Course:
    """Repeats the run step by step; an exception of the backend ends the course."""
    cell, course = task.job, Course(np.zeros((0, 3)), np.zeros((0, 3, 3)), [], 0, False, "", [])
    try:
        log, truth = archive.load(task.log)
        builder = backends.find(cell.name)
        if why := refused(builder, log):
            return course._replace(ended=why)
        log = given(builder, log, cell.options).log
        log = log if builder.associating(cell.options) else log.identified()

        def make() -> Backend:
            made = begin(builder, log.prior, cell.options, cells.generator(cell.seed, cell.backend))
            if cell.oracle and truth is not None and truth.kind == "truth" and isinstance(made, WantsTruth):
                made.tell(truth)  # as in the run
            return made

        backend = make()
    except Exception as error:
        return course._replace(ended=_said(error))
    way = _Way(task.frames, len(log))
    start = time.process_time()
    try:
        for step in log:
            way.go(backend, step)
        if not len(way.path):
            return _whole(backend, log, task.frames)
    except Exception as error:
        return way.course(_said(error))
    course = way.course("")
    if log.scans is None:
        return course._replace(constant=_constant(backend, log))
    return course._replace(revised=_revised(backend, make, log, task.frames, start))


class _Way:
    def __init__(self, frames: Ints, steps: int) -> None:
        self.frames = frames
        self._poses, self._posed = np.empty((steps, 3)), 0
        self._covs: list[Array] = []
        self._maps: list[Landmarks] = []
        self._asked, self._spent, self._steps = 0, 0.0, 0

    def go(self, backend: Backend, step: Step) -> None:
        """Makes a step, and asks for belief and map if it is that of a frame."""
        pose = backend.step(step)
        self._steps += 1
        if pose is None:
            return
        pose = np.array(pose, float)
        if not np.isfinite(pose).all():
            raise Diverged(f"step {self._steps - 1}: the pose is not finite")
        self._poses[self._posed] = pose
        self._posed += 1
        frame = len(self._covs)
        if self.frames[frame] == self._steps - 1:
            belief = backend.belief()
            known = _landmarks(backend, self) if self._due(frame) else self._maps[-1]
            cov = None if belief is None else belief.cov
            self._covs.append(np.full((3, 3), np.nan) if cov is None else np.array(cov, float))
            self._maps.append(known)

    @property
    def path(self) -> Array:
        """The poses (m, 3) so far."""
        return self._poses[: self._posed]

    def spend(self, seconds: float) -> None:
        """Counts a map and its CPU time."""
        self._asked, self._spent = self._asked + 1, self._spent + seconds

    def course(self, ended: str) -> Course:
        """The course so far."""
        return Course(self.path, np.array(self._covs).reshape(-1, 3, 3), self._maps, self._asked, False, ended, [])

    def _due(self, frame: int) -> bool:
        """True for the first frame, the last, and as long as the time lasts, evenly spent."""
        return not frame or frame == len(self.frames) - 1 or self._spent <= MAP_S * frame / len(self.frames)


def _constant(backend: Backend, log: Log, solution: Solution | None = None) -> Constant | None:
    """Asks for the errors that all ranges alone have, after the last step; None without, and of one that fails."""
    believed = log.prior.systematic
    if log.partial is None or believed.each or not (believed.range_scale > 0 or believed.range_offset > 0):
        return None
    try:
        solution = backend.finish() if solution is None else solution
        found = None if solution is None else solution.constant
        if found is None and isinstance(backend, Calibrates):
            found = backend.calibration().constant
    except Exception:  # the run's own row says what failed at the end of the log
        return None
    known = found is not None and np.isfinite([*found.range_scale, *found.range_offset]).all()
    return found if known else None


def _whole(backend: Backend, log: Log, frames: Ints) -> Course:
    """The course of a backend with a final path only: the same map at every frame."""
    solution = backend.finish()
    if solution is None:
        return Course(np.zeros((0, 3)), np.zeros((0, 3, 3)), [], 0, True, "has no path, neither online nor final", [])
    cov = np.full((len(frames), 3, 3), np.nan) if solution.cov is None else np.array(solution.cov[frames])
    known = _split(solution.map)
    constant = _constant(backend, log, solution)
    return Course(np.array(solution.path, float), cov, [known] * len(frames), len(frames), True, "", [], constant)


def _revised(backend: Backend, make: Callable[[], Backend], log: Log, frames: Ints, start: float) -> list[Revised]:
    """Asks for the path at several moments; none for a backend without, or one that fails or is not finite there."""
    found: list[Revised] = []
    try:
        last = _finished(backend)
        if last is None:
            return []
        whole = max(time.process_time() - start, 1e-9)
        some = moments(len(frames), int(np.clip(2 * REVISED_S / whole, 1, MOMENTS)))  # each, on average, half of a log
        for frame in some[:-1]:
            again = make()
            for step in islice(log, int(frames[frame]) + 1):
                again.step(step)
            path = _finished(again)
            if path is None:
                return []
            found.append(Revised(frame, path))
    except Exception:  # the run's own row says what failed at the end of the log
        return []
    return [*found, Revised(some[-1], last)]


def _finished(backend: Backend) -> Array | None:
    solution = backend.finish()
    if solution is None or not np.isfinite(solution.path).all():
        return None
    return np.array(solution.path, float)


def _landmarks(backend: Backend, way: _Way) -> Landmarks:
    start = time.process_time()
    known = _split(backend.map())
    way.spend(time.process_time() - start)
    return known


def _split(known: Map) -> Landmarks:
    n = len(known.ids)
    blocks = np.full((n, 2, 2), np.nan)
    if known.cov is not None:
        blocks = np.array(known.cov).reshape(n, 2, n, 2)[np.arange(n), :, np.arange(n)]
    return Landmarks(np.array(known.ids, np.int64), np.array(known.xy, float).reshape(n, 2), blocks)


def _said(error: Exception) -> str:
    """The exception's message, with its type where it is none of ours."""
    said = " ".join(str(error).split())
    return said if isinstance(error, SlamduelError) else f"{type(error).__name__}: {said}"
