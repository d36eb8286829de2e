"""A front end for depth cameras that times its parts, and after them what they are compared with."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...frontend.depth.features import Features, detector
from ...frontend.depth.front_end import FrontEnd
from ...frontend.depth.level import Level
from ...frontend.depth.pairs import Keyframe, Pair, Trial
from ...frontend.depth.planar import Planar
from ...frontend.depth.recording import DepthFrame, DepthRecording
from ...frontend.depth.settings import Settings
from ...frontend.depth.surfaces import Coarse
from ...frontend.maps.cloud import Cloud
from .depth_references import matches, motion

PARTS = ("features", "levelling", "clouds", "registration", "tracks")
"""Registration includes the matching of descriptors and the comparison of surfaces."""

LOOPS = "loop search"

BETWEEN = 5
"""Frames looked at from one after which the references for pairs are timed, and memory is counted, to the next."""


class Registered(NamedTuple):
    """Two steps, and the motion from one to the other."""

    first: int
    second: int
    motion: Planar


class PairTimes(NamedTuple):
    """ns of pairs, and of the reference on some of them, beside ours."""

    ns: list[int]
    ours: list[int]
    theirs: list[int]


class Timed(FrontEnd):
    """A front end with the ns of CPU that its parts took."""

    def __init__(self, recording: DepthRecording, settings: Settings) -> None:
        super().__init__(recording.camera, settings, recording.motion)
        self.ns: dict[str, int] = dict.fromkeys((*PARTS, LOOPS), 0)
        self.frame_ns, self.loop_ns, self.orb_ns = list[int](), list[int](), list[int]()  # of frames looked at
        self.neighbours, self.searched = PairTimes([], [], []), PairTimes([], [], [])
        self.motions: dict[str, list[Registered]] = {"neighbours": [], "loop": []}
        self.held: list[tuple[int, int]] = []  # frames looked at, and bytes held then
        self._asked: tuple[Keyframe, Keyframe, int] | None = None  # the first pair of the frame, and its ns

    def drive(self, recording: DepthRecording, frames: int, progress: Callable[[], None]) -> None:
        """Takes the first `frames` frames, and times the references after them."""
        orb = detector(replace(self.settings, features="orb"))
        focal = float(np.mean(recording.camera.focal))
        for number, frame in enumerate(recording.in_order()):
            if number == frames:
                break
            looked, loops, self._asked = self.counts["frames looked at"], self.ns[LOOPS], None
            searched = self.search.searched
            start = time.thread_time_ns()
            self.frame(frame)
            spent = time.thread_time_ns() - start
            progress()
            if self.counts["frames looked at"] == looked:
                continue
            searching = self.ns[LOOPS] - loops
            self.frame_ns.append(spent - searching)
            self.loop_ns.append(searching)
            start = time.thread_time_ns()
            orb.detectAndCompute(frame.grey, None)
            self.orb_ns.append(time.thread_time_ns() - start)
            if len(self.frame_ns) % BETWEEN == 0:
                self._refer(focal, searching, self.search.searched - searched)
                self.held.append((len(self.frame_ns), held(self)))
        self.finish()
        self.motions["loop"] = [Registered(loop.to, loop.step, loop.motion) for loop in self.loops]
        self.held.append((len(self.frame_ns), held(self)))

    def _refer(self, focal: float, searching: int, searched: int) -> None:
        """Times the references on the last pair of neighbours and on one of the `searched` places."""
        if self._asked is None:
            return
        first, second, ours = self._asked
        ratio = self.settings.ratio
        start = time.thread_time_ns()
        motion(first.features, second.features, ratio, focal)
        self.neighbours.theirs.append(time.thread_time_ns() - start)
        self.neighbours.ours.append(ours)
        if searched:
            place = self.search.places[len(self.frame_ns) // BETWEEN % len(self.search.places)]
            start = time.thread_time_ns()
            matches(place.features, second.features, ratio)
            self.searched.theirs.append(time.thread_time_ns() - start)
            self.searched.ours.append(searching // searched)

    def _features(self, frame: DepthFrame) -> Features:
        return self._timed("features", super()._features, frame)

    def _level(self, frame: DepthFrame) -> Level:
        return self._timed("levelling", super()._level, frame)

    def _coarse(self, frame: DepthFrame) -> Coarse:
        return self._timed("registration", super()._coarse, frame)

    def _cloud(self, frame: DepthFrame, level: Level) -> Cloud:
        return self._timed("clouds", super()._cloud, frame, level)

    def _registered(self, old: Keyframe, new: Keyframe, known: Callable[[], Planar] | None) -> Trial:
        before = self.ns["registration"]
        trial: Trial = self._timed("registration", super()._registered, old, new, known)
        spent = self.ns["registration"] - before
        self.neighbours.ns.append(spent)
        self._asked = self._asked or (old, new, spent)
        if trial.pair is not None:
            self.motions["neighbours"].append(Registered(old.step, new.step, trial.pair.motion))
        return trial

    def _track(self, pair: Pair) -> None:
        self._timed("tracks", super()._track, pair)

    def _close(self, frame: Keyframe) -> None:
        tracks, searched, before = self.ns["tracks"], self.search.searched, self.ns[LOOPS]
        self._timed(LOOPS, super()._close, frame)
        self.ns[LOOPS] -= self.ns["tracks"] - tracks
        count = self.search.searched - searched
        self.searched.ns.extend([(self.ns[LOOPS] - before) // count] * count if count else [])

    def _timed(self, part: str, do: Callable[..., Any], *given: Any) -> Any:
        start = time.thread_time_ns()
        found = do(*given)
        self.ns[part] += time.thread_time_ns() - start
        return found


def held(one: object) -> int:
    """The bytes of all arrays that an object holds on to, each counted once."""
    seen, total, rest = set[int](), 0, [one]
    while rest:
        one = rest.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            if one.base is None:
                total += one.nbytes
            else:
                rest.append(one.base)
        elif isinstance(one, Mapping):
            rest += one.values()
        elif isinstance(one, (list, tuple, deque)):
            rest += one
        else:
            rest += getattr(one, "__dict__", {}).values()
    return total
