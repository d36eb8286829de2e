"""The front end: frames of a depth camera one after another become steps with odometry, and landmarks or loops.

RGBD-SLAM's way (Endres, Hess, Sturm, Cremers and Burgard, T-RO 2014) for a robot on a floor: features with depth are
matched, registered and checked; what passes is either a landmark's sighting or a loop closure, never both.
"""

from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from ..camera.camera import Camera
from ..errors import InputError
from ..se2 import Array
from ..wheels.motion import Motion
from .features import Features, Finder
from .frame import DepthFrame
from .level import Level, Leveller
from .loops import Loops
from .pairs import Keyframe, Pair, Pairs, without_ids
from .planar import Planar
from .settings import Settings
from .surfaces import Coarse
from .tracks import Tracks
from .ways import Ways

BEFORE = (1, 3)
"""Steps back to the keyframes that a new one's features are matched with."""


class Step(NamedTuple):
    """A step of the log."""

    t: float  # s
    motion: Planar | None  # since the step before; None at first


class Loop(NamedTuple):
    """A loop closure of the log."""

    to: int  # the earlier step
    step: int
    motion: Planar  # the pose of `step` in that of `to`


class FrontEnd:
    """Takes frames in the order of time."""

    def __init__(self, camera: Camera, settings: Settings, motion: Motion | None) -> None:
        self.settings, self.camera = settings, camera
        self.steps: list[Step] = []
        self.loops: list[Loop] = []
        self.counts, self.turned_down = Counter[str](), Counter[str]()
        self.tracks, self._ways = Tracks(settings), Ways()
        self._motion = motion
        self._finder, self._leveller, self._pairs = (
            Finder(camera, settings), Leveller(camera, settings), Pairs(camera, settings),
        )  # fmt: skip
        self.search = Loops(self._pairs, self._ways, settings, motion is not None)
        self._recent = deque[Keyframe](maxlen=max(BEFORE) + 1)
        self._last: tuple[Keyframe, Pair] | None = None  # the last frame that is no step, seen from the last step

    def frame(self, frame: DepthFrame) -> None:
        """Takes a frame; a step begins where the robot has moved enough since the last one."""
        self.counts["frames"] += 1
        if self._motion is not None:
            first, last = self._motion.t[[0, -1]]
            if not first <= frame.seconds <= last:
                self.counts[f"frames without {self._motion.readings}"] += 1
                return
        if not self.steps:
            self._start(self._keyframe(frame))
        elif self.settings.odometry == "wheels":
            self._step_by_wheels(frame)
        else:
            self._step_by_sight(frame)

    def finish(self) -> None:
        """Ends the drive with the last frame, where the motion comes from frames alone."""
        if self._last is not None:
            self._step(self._last[0], self._last[1].motion)

    def _keyframe(self, frame: DepthFrame) -> Keyframe:
        """Finds what a frame shows."""
        size = (self.camera.height, self.camera.width)
        for name, image in (("grey image", frame.grey), ("depth image", frame.depth)):
            if image.shape != size:
                raise InputError(
                    f"frame at {frame.seconds:.6f} s: found a {name} of {' x '.join(map(str, image.shape[::-1]))} "
                    f"pixels, expected {size[1]} x {size[0]} as the camera's calibration says."
                )
        self.counts["frames looked at"] += 1
        features, level = self._features(frame), self._level(frame)
        self.counts["frames without a floor"] += not level.found
        self.counts["features"] += len(features)
        return Keyframe(len(self.steps), frame.seconds, features, level, self._surfaces(frame), without_ids(features))

    def _features(self, frame: DepthFrame) -> Features:
        return self._finder.find(frame.grey, frame.depth)

    def _level(self, frame: DepthFrame) -> Level:
        return self._leveller.level(frame.depth)

    def _surfaces(self, frame: DepthFrame) -> Coarse:
        return self._pairs.coarse(frame.depth)

    def _start(self, frame: Keyframe) -> None:
        self.steps.append(Step(frame.t, None))
        self._recent.append(frame)
        self.search.remember(frame, ())

    def _step_by_wheels(self, frame: DepthFrame) -> None:
        """Takes a frame where the wheels tell the motion; one before the next step is not looked at."""
        s, moved = self.settings, self._by_wheels(frame.seconds)
        if np.hypot(moved.delta[0], moved.delta[1]) < s.step and abs(moved.delta[2]) < s.turn:
            return
        new = self._keyframe(frame)
        self._step(new, moved)
        if s.landmarks:
            for before in BEFORE:
                if before < len(self._recent):
                    self._link(self._recent[-1 - before], new)

    def _link(self, old: Keyframe, new: Keyframe) -> None:
        """Makes the features of two keyframes landmarks."""
        pair = self._register(old, new, lambda: self._ways.motion(old.step, new.step))
        if pair is not None:
            self._track(pair)

    def _register(self, old: Keyframe, new: Keyframe, known: Callable[[], Planar] | None) -> Pair | None:
        """Registers two keyframes; None where they cannot be. `known` is asked for the motion that the wheels tell."""
        self.counts["pairs"] += 1
        pair = self._pairs.register(old, new, self.settings.inliers, self.turned_down, known)
        self.counts["pairs registered"] += pair is not None
        return pair

    def _track(self, pair: Pair) -> None:
        """Makes the features of two registered keyframes the same landmarks."""
        self.tracks.link(pair)

    def _step_by_sight(self, frame: DepthFrame) -> None:
        """Takes a frame where its own features tell the motion since the last step."""
        s, new = self.settings, self._keyframe(frame)
        pair = self._seen_from_last(new)
        if pair is None and self._last is not None:
            self._step(self._last[0], self._last[1].motion)
            new = self._renumbered(new)
            pair = self._seen_from_last(new)
        if pair is None:
            self._step(new, self._unseen(new))
            return
        delta = pair.motion.delta
        if np.hypot(delta[0], delta[1]) < s.step and abs(delta[2]) < s.turn:
            self._last = (new, pair)
            return
        self._step(new, pair.motion)

    def _seen_from_last(self, new: Keyframe) -> Pair | None:
        """Registers a frame with the last step's, checked against the wheels where there are some."""
        return self._register(self._recent[-1], new, None if self._motion is None else partial(self._by_wheels, new.t))

    def _unseen(self, new: Keyframe) -> Planar:
        """The motion since the last step where no features tell it: the wheels', or without them the one before."""
        if self._motion is not None:
            self.counts["steps by the wheels alone"] += 1
            return self._by_wheels(new.t)
        self.counts["steps without a motion"] += 1
        s = self.settings
        return Planar(self._as_before(new.t), np.diag([s.blind**2, s.blind**2, s.blind_turn**2]))

    def _by_wheels(self, t: float) -> Planar:
        """The wheels' motion from the last step to a time."""
        assert self._motion is not None
        return Planar(*self._motion.odometry(self.steps[-1].t, t))

    def _as_before(self, t: float) -> Array:
        """The motion (3,) of the last step, at its speed."""
        if len(self.steps) < 2:
            return np.zeros(3)
        last, before = self.steps[-1], self.steps[-2]
        assert last.motion is not None
        return last.motion.delta * min((t - last.t) / (last.t - before.t), 2.0)

    def _renumbered(self, frame: Keyframe) -> Keyframe:
        return Keyframe(len(self.steps), frame.t, frame.features, frame.level, frame.coarse, frame.ids)

    def _step(self, frame: Keyframe, motion: Planar) -> None:
        """Begins a step, and looks for places that were seen before."""
        self._last = None
        self.steps.append(Step(frame.t, motion))
        self._ways.step(motion)
        self._recent.append(frame)
        if self.settings.loops or self.settings.landmarks:
            self._close(frame)

    def _close(self, frame: Keyframe) -> None:
        """Searches the places that were seen before."""
        found = self.search.search(frame)
        for pair in found:
            self._join(pair)
        self.search.remember(frame, found)

    def _join(self, pair: Pair) -> None:
        """Closes a loop, or makes the features of its two keyframes the same landmarks."""
        self._ways.join(pair.first.step, pair.second.step, pair.motion)
        if self.settings.loops:
            self.loops.append(Loop(pair.first.step, pair.second.step, pair.motion))
        else:
            self._track(pair)
