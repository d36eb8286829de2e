"""Drives a backend through its log once more, in a process of its own, and asks for its map on the way."""

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...backends import registry as backends
from ...backends.api import Backend, Diverged, Map, WantsTruth
from ...backends.locating.locating import begin
from ...datasets import archive
from ...frontend.errors import SlamduelError
from ...frontend.factors import Step
from ...frontend.se2 import Array, Ints
from ..measure import cell as cells

MAP_S = 20.0  # s of CPU time for all maps: a smoother's map is slow where there are thousands of steps


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


class Course(NamedTuple):
    """The course of a backend, as far as it got."""

    path: Array  # (m, 3) of the first m steps
    cov: Array  # (g, 3, 3) at the first g frames, NaN where not known
    maps: list[Landmarks]  # (g,)
    asked: int  # number of frames whose map was asked for; the others repeat the one before
    final: bool  # path and map are those of the end, there are no online ones
    ended: str  # why it stopped, "" where it reached the end


def run(task: ReplayTask) -> Course:
    """Repeats the run step by step; an exception of the backend ends the course."""
    cell, course = task.job, Course(np.zeros((0, 3)), np.zeros((0, 3, 3)), [], 0, False, "")
    try:
        log, truth = archive.load(task.log)
        builder = backends.find(cell.name)
        if len(log.loop_to) and not builder.loops:
            if not builder.leaves_out_loops:
                return course._replace(ended="the log has loop closures, which this backend does not take")
            log = log.without_loops()
        log = log if builder.associating(cell.options) else log.identified()
        backend = begin(builder, log.prior, cell.options, cells.generator(cell.seed, cell.backend))
        if cell.oracle and truth is not None and truth.kind == "truth" and isinstance(backend, WantsTruth):
            backend.tell(truth)  # as in the run
    except Exception as error:
        return course._replace(ended=_said(error))
    way = _Way(task.frames)
    ended = ""
    try:
        for step in log:
            way.go(backend, step)
        if not way.path:
            return _whole(backend, task.frames)
    except Exception as error:
        ended = _said(error)
    return way.course(ended)


class _Way:
    def __init__(self, frames: Ints) -> None:
        self.frames = frames
        self.path: list[Array] = []
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
        self.path.append(pose)
        frame = len(self._covs)
        if self.frames[frame] == self._steps - 1:
            belief = backend.belief()
            known = _landmarks(backend, self) if self._due(frame) else self._maps[-1]
            cov = None if belief is None else belief.cov
            self._covs.append(np.full((3, 3), np.nan) if cov is None else np.array(cov, float))
            self._maps.append(known)

    def spend(self, seconds: float) -> None:
        """Counts a map and its CPU time."""
        self._asked, self._spent = self._asked + 1, self._spent + seconds

    def course(self, ended: str) -> Course:
        """Returns the course so far."""
        path = np.array(self.path).reshape(-1, 3)
        return Course(path, np.array(self._covs).reshape(-1, 3, 3), self._maps, self._asked, False, ended)

    def _due(self, frame: int) -> bool:
        """Returns True for the first frame, the last, and as long as the time lasts, evenly spent."""
        return not frame or frame == len(self.frames) - 1 or self._spent <= MAP_S * frame / len(self.frames)


def _whole(backend: Backend, frames: Ints) -> Course:
    """Returns the course of a backend with a final path only: the same map at every frame."""
    solution = backend.finish()
    if solution is None:
        return Course(np.zeros((0, 3)), np.zeros((0, 3, 3)), [], 0, True, "has no path, neither online nor final")
    cov = np.full((len(frames), 3, 3), np.nan) if solution.cov is None else np.array(solution.cov[frames])
    known = _split(solution.map)
    return Course(np.array(solution.path, float), cov, [known] * len(frames), len(frames), True, "")


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
    """Returns the exception's message, with its type where it is none of ours."""
    said = " ".join(str(error).split())
    return said if isinstance(error, SlamduelError) else f"{type(error).__name__}: {said}"
