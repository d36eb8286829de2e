"""Measures the front end for depth cameras: CPU time of a frame and of loop search, memory, errors and covariances."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.factors import Truth
from ...core.se2 import Array
from ...datasets.depth.open import open_depth
from ...datasets.worlds.depth_room import Options, record
from ...frontend.depth.log import log_of
from ...frontend.depth.recording import DepthRecording
from ...frontend.depth.settings import Settings
from .consistency import Consistency, errors, gathered
from .depth_timed import PARTS, PairTimes, Timed

MEGABYTE = 1e6


class DepthExtent(NamedTuple):
    """The extent of the study."""

    drives: int  # in rendered rooms, one each
    laps: float
    frames: int  # of a recording, at most


QUICK, FULL = DepthExtent(1, 1.2, 100), DepthExtent(2, 3.0, 100_000)


class FrameCost(NamedTuple):
    """ms of CPU that the frames of a log take, beside loop search."""

    log: str
    frames: int  # that were looked at: the wheels leave out those where the robot has hardly moved
    median: float
    mean: float
    p99: float
    parts: tuple[float, ...]  # means of PARTS
    orb: float  # the mean of OpenCV's ORB alone, on the same frames
    ratio: float  # the mean by that of ORB


class PairCost(NamedTuple):
    """ms of CPU that pairs of frames take."""

    kind: str
    log: str
    pairs: int
    mean: float
    p99: float
    reference: float  # the mean of OpenCV's program for it, on some of the pairs
    ratio: float  # the mean by that, on the same pairs


class LoopCost(NamedTuple):
    """ms of CPU that loop search takes for a frame, and what the front end holds in memory."""

    log: str
    frames: int
    median: float
    mean: float
    p99: float
    places: int  # searched at the end
    held_mb: float  # in arrays, at the end
    held_kb: float  # more per frame, over the last half


DepthRow = FrameCost | PairCost | LoopCost | Consistency


class DepthDrive(NamedTuple):
    """A recording and its front end, at the end."""

    recording: DepthRecording
    front_end: Timed
    truth: Truth | None  # at the times of the frames


@dataclass(frozen=True, eq=False)
class DepthStudy:
    """Drives in rendered rooms, and a recording."""

    seed: int = 0
    extent: DepthExtent = FULL
    recording: Path | None = None  # a folder of images or a bag

    def warm_up(self) -> None:
        """Loads all kernels, on the start of a drive."""
        cv2.setNumThreads(1)
        recording, truth = record(Options(laps=0.3), self._rng(2))
        _driven(recording, Settings(), truth, 30, lambda: None)

    def drives(self, progress: Callable[[], None]) -> list[DepthDrive]:
        """Takes the front end through the rendered rooms."""
        options = Options(laps=self.extent.laps)
        return [
            _driven(recording, options, truth, len(truth.t), progress)
            for recording, truth in (record(options, self._rng(0, number)) for number in range(self.extent.drives))
        ]

    def recorded(self, progress: Callable[[], None]) -> DepthDrive | None:
        """Takes it through the recording; None where none is given, InputError for what cannot be a log."""
        if self.recording is None:
            return None
        opened = open_depth(self.recording)
        if opened is None:
            raise InputError(f"--frames {self.recording}: found no colour and depth images, expected a recording")
        drive = _driven(opened.recording, opened.settings, None, self.extent.frames, progress)
        log_of(drive.recording, drive.front_end)  # refuses a drive without two steps
        return drive

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, *stream])


def _driven(
    recording: DepthRecording, settings: Settings, truth: Truth | None, frames: int, progress: Callable[[], None]
) -> DepthDrive:
    front_end = Timed(recording, settings)
    front_end.drive(recording, frames, progress)
    return DepthDrive(recording, front_end, truth)


def frame_cost(drives: Sequence[DepthDrive]) -> FrameCost:
    """Summarises the CPU time of all frames of some drives."""
    ends = [drive.front_end for drive in drives]
    ms, orb = (1e-6 * np.concatenate(ns) for ns in ([e.frame_ns for e in ends], [e.orb_ns for e in ends]))
    parts = tuple(1e-6 * sum(end.ns[part] for end in ends) / len(ms) for part in PARTS)
    median, p99 = np.percentile(ms, (50, 99)).tolist()
    mean, alone = float(ms.mean()), float(orb.mean())
    return FrameCost(drives[0].recording.name, len(ms), median, mean, p99, parts, alone, mean / alone)


def pair_costs(drives: Sequence[DepthDrive]) -> list[PairCost]:
    """Summarises the CPU time of registering neighbours and of searching a place, beside the references."""
    name, ends = drives[0].recording.name, [drive.front_end for drive in drives]
    kinds = {"neighbours": [end.neighbours for end in ends], "loop": [end.searched for end in ends]}
    return [_pair_cost(kind, name, pairs) for kind, pairs in kinds.items() if any(one.theirs for one in pairs)]


def _pair_cost(kind: str, log: str, parts: Sequence[PairTimes]) -> PairCost:
    ms, ours, theirs = (1e-6 * np.concatenate(column) for column in zip(*parts, strict=True))
    p99, reference = float(np.percentile(ms, 99)), float(theirs.mean())
    return PairCost(kind, log, len(ms), float(ms.mean()), p99, reference, float(ours.mean()) / reference)


def loop_cost(drives: Sequence[DepthDrive]) -> LoopCost:
    """Summarises the CPU time of loop search, and the memory that is held at the end, the most of all drives."""
    ms = 1e-6 * np.concatenate([drive.front_end.loop_ns for drive in drives])
    median, p99 = np.percentile(ms, (50, 99)).tolist()
    most = max((drive.front_end for drive in drives), key=lambda end: end.held[-1][1])
    (frames, half), (last, end) = most.held[len(most.held) // 2], most.held[-1]
    grown = 1e-3 * (end - half) / max(last - frames, 1)
    return LoopCost(
        drives[0].recording.name, len(ms), median, float(ms.mean()), p99, len(most.search.places), end / MEGABYTE, grown
    )


def consistency(drives: Sequence[DepthDrive]) -> list[Consistency]:
    """Compares the errors of registered pairs with their covariances."""
    rows = list[Consistency]()
    for kind in ("neighbours", "loop"):
        parts = list[tuple[Array, Array]]()
        for drive in drives:
            assert drive.truth is not None
            found = drive.front_end.motions[kind]
            if found:
                t = [step.t for step in drive.front_end.steps]
                true = drive.truth.poses[np.searchsorted(drive.truth.t, t)]
                first, second = true[[pair.first for pair in found]], true[[pair.second for pair in found]]
                off = errors(np.array([pair.motion.delta for pair in found]), first, second)
                parts.append((off, np.array([pair.motion.cov for pair in found])))
        rows += gathered(kind, parts)
    return rows
