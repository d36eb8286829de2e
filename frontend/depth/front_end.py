"""The front end: frames of a depth camera one after another become steps with odometry, and landmarks or loops.

RGBD-SLAM's way (Endres, Hess, Sturm, Cremers and Burgard, T-RO 2014) for a robot on a floor: features with depth are
matched, registered and checked; what passes is either a landmark's sighting or a loop closure, never both.
"""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, wrap
from ..camera.camera import Camera
from ..inertial.tilts import Tilts
from ..maps.cloud import BLUR, Cloud, cloud_of
from ..maps.spool import Spool
from ..wheels.motion import Motion
from .features import Features, Finder
from .level import Level, Leveller
from .loops import Loops
from .pairs import Keyframe, Pair, Pairs, Trial, without_ids
from .planar import Planar
from .recording import DepthFrame
from .settings import Settings
from .surfaces import Coarse
from .tracks import Tracks
from .ways import Ways

SPARSE = 8  # px between the depths whose median is taken
APART = 3  # steps back to the keyframe that a new one's features are matched with, beside the last one's

BY_GRAVITY = "of these levelled by gravity"

DENIED = "steps whose wheels the frames deny"


class FrameStep(NamedTuple):
    """A step of the log."""

    t: float  # s
    motion: Planar | None  # since the step before; None at first
    level: Level


class FrameFindings(NamedTuple):
    """The front end's findings in one frame."""

    frame: DepthFrame
    keyframe: Keyframe | None  # None: it was not looked at
    trials: Sequence[Trial]  # attempts to register it with the steps before
    loops: Sequence[Trial]  # and with places that were seen before
    stepped: bool  # the log has a step there


class FrameLoop(NamedTuple):
    """A place that was seen again: a loop closure of the log, or a reason for features to be the same landmarks."""

    to: int  # the earlier step
    step: int
    motion: Planar  # the pose of `step` in that of `to`


class FrontEnd:
    """Takes frames in the order of time."""

    def __init__(self, camera: Camera, settings: Settings, motion: Motion | None, tilts: Tilts | None = None) -> None:
        self.settings, self.camera = settings, camera
        self.t = list[float]()  # s, of the frames
        self.floorless = list[float]()  # s, of those looked at that show no floor
        self.depths = list[float]()  # m, the median of each frame looked at, where it has any
        self.steps: list[FrameStep] = []
        self.loops: list[FrameLoop] = []
        self.told: list[FrameLoop] = []  # of a step to the one before it, by their features alone
        self.clouds = Spool()  # of the steps
        self.counts, self.turned_down = Counter[str](), Counter[str]()
        self.tracks, self._ways = Tracks(settings), Ways()
        self._motion = motion
        self._finder, self._leveller, self._pairs = (
            Finder(camera, settings), Leveller(camera, settings, tilts), Pairs(camera, settings),
        )  # fmt: skip
        self.search = Loops(self._pairs, self._ways, settings, motion is not None)
        self._recent = deque[Keyframe](maxlen=APART + 1)
        blurred = np.sqrt(max(BLUR - settings.constant_sd, 0.0) / settings.depth_sd)
        self._sharp = min(settings.far, float(blurred))  # m, the farthest points of a cloud
        self.seen: FrameFindings | None = None  # of the last frame
        self._trials: list[Trial] = []
        self._last: tuple[Keyframe, Pair] | None = None  # the last frame that is no step, seen from the last step

    def frame(self, frame: DepthFrame) -> None:
        """Takes a frame; a step begins where the robot has moved enough since the last one."""
        self.counts["frames"] += 1
        self.t.append(frame.seconds)
        self._trials, self.search.trials = [], []
        steps, keyframe = len(self.steps), self._taken(frame)
        stepped = keyframe is not None and len(self.steps) > steps and self._recent[-1] is keyframe
        self.seen = FrameFindings(frame, keyframe, self._trials, self.search.trials, stepped)

    def _taken(self, frame: DepthFrame) -> Keyframe | None:
        """Takes a frame; None for one that is not looked at."""
        if self._motion is not None:
            first, last = self._motion.t[[0, -1]]
            if not first <= frame.seconds <= last:
                self.counts[f"frames without {self._motion.readings}"] += 1
                return None
        if not self.steps:
            return self._start(self._keyframe(frame))
        return self._step_by_wheels(frame) if self.settings.odometry == "wheels" else self._step_by_sight(frame)

    def finish(self) -> None:
        """Ends the drive with the last frame, where the motion comes from frames alone."""
        if self._last is not None:
            self._step_by(*self._last)

    @property
    def path(self) -> Array:
        """The poses (n, 3) of the steps in the frame of the first one, over steps and loops of least variance."""
        return self._ways.path()

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
        some = frame.depth[::SPARSE, ::SPARSE]
        self.depths += [float(np.median(some[some > 0]))] if (some > 0).any() else []
        features, level = self._features(frame), self._level(frame)
        self.counts["frames without a floor"] += not level.found
        self.floorless += [] if level.found else [frame.seconds]
        if level.by_gravity:
            self.counts[BY_GRAVITY] += 1
        self.counts["features"] += len(features)
        coarse, cloud = self._coarse(frame), self._cloud(frame, level)
        return Keyframe(len(self.steps), frame.seconds, features, level, coarse, without_ids(features), cloud)

    def _features(self, frame: DepthFrame) -> Features:
        return self._finder.find(frame.grey, frame.depth)

    def _level(self, frame: DepthFrame) -> Level:
        return self._leveller.level(frame.depth, frame.seconds)

    def _coarse(self, frame: DepthFrame) -> Coarse:
        return self._pairs.coarse(frame.depth)

    def _cloud(self, frame: DepthFrame, level: Level) -> Cloud:
        colour = frame.grey if frame.colour is None else frame.colour
        return cloud_of(self.camera, level.T, frame.depth, colour, (self.settings.near, self._sharp))

    def _start(self, frame: Keyframe) -> Keyframe:
        self.steps.append(FrameStep(frame.t, None, frame.level))
        self.clouds.add(frame.cloud)
        self._recent.append(frame)
        self.search.remember(frame, ())
        return frame

    def _step_by_wheels(self, frame: DepthFrame) -> Keyframe | None:
        """Takes a frame where the wheels tell the motion; one before the next step is not looked at."""
        s, moved = self.settings, self._by_wheels(frame.seconds)
        if np.hypot(moved.delta[0], moved.delta[1]) < s.step and abs(moved.delta[2]) < s.turn:
            return None
        new = self._keyframe(frame)
        trial = self._registered(self._recent[-1], new, lambda: moved)
        denied = trial.pair is None and self._pairs.deny(trial.first, new, moved)
        doubted = self._doubted(trial, denied, moved)
        self._step(new, doubted)
        if trial.pair is not None:
            self._keep(new, trial.pair)
        if s.landmarks:
            if denied and trial.denied is not None:
                trial = self._registered(trial.first, new, lambda: doubted)
            if trial.pair is not None:
                self._track(trial.pair)
            if len(self._recent) > APART:
                old = self._recent[-1 - APART]
                trial = self._registered(old, new, partial(self._ways.motion, old.step, new.step))
                if trial.pair is not None:
                    self._track(trial.pair)
        return new

    def _doubted(self, trial: Trial, denied: bool, wheels: Planar) -> Planar:
        """The wheels' motion, less certain where features, or the depths alone, as `denied` says, deny it."""
        s = self.settings
        if trial.denied is not None:
            off = trial.denied.delta - wheels.delta
            way = np.hypot(off[0], off[1])
            more = np.diag([way**2, way**2, wrap(off[2]) ** 2])
        elif denied:
            more = np.diag([s.blind**2, s.blind**2, s.blind_turn**2])
        else:
            return wheels
        self.counts[DENIED] += 1
        return Planar(wheels.delta, wheels.cov + more)

    def _track(self, pair: Pair) -> None:
        """Makes the features of two registered keyframes the same landmarks."""
        self.tracks.link(pair)

    def _registered(self, old: Keyframe, new: Keyframe, known: Callable[[], Planar] | None) -> Trial:
        """Registers two keyframes, and counts what comes of it. `known` is asked for the wheels' motion."""
        trial = self._pairs.register(old, new, self.settings.inliers, known)
        self._trials.append(trial)
        self.counts["pairs"] += 1
        self.counts["pairs registered"] += trial.pair is not None
        if trial.pair is None:
            self.turned_down[trial.reason] += 1
        return trial

    def _step_by_sight(self, frame: DepthFrame) -> Keyframe:
        """Takes a frame where its own features tell the motion since the last step."""
        s, new = self.settings, self._keyframe(frame)
        pair = self._seen_from_last(new)
        if pair is None and self._last is not None:
            self._step_by(*self._last)
            new = self._renumbered(new)
            pair = self._seen_from_last(new)
        if pair is None:
            self._step(new, self._unseen(new))
            return new
        delta = pair.motion.delta
        if np.hypot(delta[0], delta[1]) < s.step and abs(delta[2]) < s.turn:
            self._last = (new, pair)
        else:
            self._step_by(new, pair)
        return new

    def _step_by(self, frame: Keyframe, pair: Pair) -> None:
        """Begins a step with the motion that its own features tell."""
        self._step(frame, pair.motion)
        self._keep(frame, pair)

    def _keep(self, frame: Keyframe, pair: Pair) -> None:
        """Keeps the motion of a step by the features of two frames."""
        self.told.append(FrameLoop(pair.first.step, frame.step, pair.motion))

    def _seen_from_last(self, new: Keyframe) -> Pair | None:
        """Registers a frame with the last step's, checked against the wheels where there are some."""
        known = None if self._motion is None else partial(self._by_wheels, new.t)
        return self._registered(self._recent[-1], new, known).pair

    def _unseen(self, new: Keyframe) -> Planar:
        """The motion since the last step where no features tell it: the wheels', or without them the one before."""
        if self._motion is not None:
            self.counts["steps by the wheels alone"] += 1
            moved = self._by_wheels(new.t)
            return self._doubted(self._trials[-1], self._pairs.deny(self._recent[-1], new, moved), moved)
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
        return replace(frame, step=len(self.steps))

    def _step(self, frame: Keyframe, motion: Planar) -> None:
        """Begins a step, and looks for places that were seen before."""
        self._last = None
        self.steps.append(FrameStep(frame.t, motion, frame.level))
        self.clouds.add(frame.cloud)
        self._ways.step(motion)
        self._recent.append(frame)
        if self.settings.loops or self.settings.landmarks:
            self._close(frame)

    def _close(self, frame: Keyframe) -> None:
        """Searches the places that were seen before."""
        found = self.search.search(frame)
        for pair in found:
            self._ways.join(pair.first.step, pair.second.step, pair.motion)
            self.loops.append(FrameLoop(pair.first.step, pair.second.step, pair.motion))
            if self.settings.landmarks:
                self._track(pair)
        self.search.remember(frame, found)
