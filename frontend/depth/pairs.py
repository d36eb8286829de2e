"""Keyframes, and the motion between two of them, from their features to what passes all checks.

Where a check fails, most of the matches are of something that moves, or of another place that looks alike: they are
dropped, and the others are registered once more.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.se2 import Ints
from ..camera.camera import Camera
from ..maps.cloud import NOTHING, Cloud
from .features import Features, matched
from .level import Level
from .planar import Planar, camera_motion, distance, planar
from .points import Points, sharing
from .registration import registered
from .settings import Settings
from .surfaces import Coarse, Surfaces

TRIES = 2


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame as it is kept."""

    step: int
    t: float  # s
    features: Features  # n of them
    level: Level
    coarse: Coarse
    ids: Ints  # (n,) of the features' landmarks, -1 without one; `Tracks` writes them
    cloud: Cloud = NOTHING  # of the whole frame


def without_ids(features: Features) -> Ints:
    """(n,) the ids of features that are no landmarks yet."""
    return np.full(len(features), -1, np.int64)


class Pair(NamedTuple):
    """Two keyframes that were registered."""

    first: Keyframe
    second: Keyframe
    motion: Planar  # the pose of the second in the first
    rows: Ints  # (k, 2) the features of both that agree


class Trial(NamedTuple):
    """An attempt to register two keyframes."""

    first: Keyframe
    second: Keyframe
    pair: Pair | None  # None: it was refused
    reason: str  # why; "" otherwise
    matches: Ints  # (m, 2) the features of both that look alike
    contradicted: Ints  # (c, 2) those that agreed with a motion which a check refused: often of something that moves
    denied: Planar | None = None  # the motion that was refused as it contradicts the wheels


class Pairs:
    """Registers keyframes of one camera."""

    def __init__(self, camera: Camera, settings: Settings) -> None:
        self._settings, self._surfaces = settings, Surfaces(camera, settings)
        self.coarse = self._surfaces.coarse

    def register(self, first: Keyframe, second: Keyframe, least: int, known: Callable[[], Planar] | None) -> Trial:
        """Registers two keyframes by `least` features; refused where they are too few or a check fails.

        `known` is asked for the motion that the wheels tell, once there are enough matches.
        """
        s = self._settings
        rows = matches = matched(first.features.descriptors, second.features.descriptors, s.ratio)
        if len(rows) < least:
            return Trial(first, second, None, "too few matches", matches, rows[:0])
        wheels = None if known is None else known()
        guess = None if wheels is None else camera_motion(wheels.delta, first.level, second.level)
        rng = np.random.default_rng((first.step, second.step))
        reason, contradicted, denied = "", rows[:0], None
        for _ in range(TRIES):
            one, other = _together(first.features, rows[:, 0]), _together(second.features, rows[:, 1])
            found = registered(one, other, s, rng, guess)
            if found is None or len(found.inliers) < least:
                reason = reason or "too few matches agree"
                break
            motion = planar(found, first.level, second.level, s)
            sd = np.sqrt(np.diag(motion.cov))
            if max(sd[0], sd[1]) > s.weak or sd[2] > s.weak_turn:
                reason = reason or "the view is degenerate"
                break
            if s.surfaces and not self._surfaces.agree(first.coarse, second.coarse, found.R, found.t):
                reason = reason or "one frame sees through the other's surfaces"
            elif s.wheels_check and wheels is not None and distance(motion, wheels) > s.wheels_gate:
                reason = reason or "it contradicts the wheels"
                denied = denied or motion
            else:
                pair = Pair(first, second, motion, rows[found.inliers])
                return Trial(first, second, pair, "", matches, contradicted)
            contradicted = np.concatenate((contradicted, rows[found.inliers]))
            rows = np.delete(rows, found.inliers, axis=0)
        return Trial(first, second, None, reason, matches, contradicted, denied)

    def deny(self, first: Keyframe, second: Keyframe, motion: Planar) -> bool:
        """Tells if one of two frames sees through the other's surfaces, where the robot moved so between them."""
        moved = camera_motion(motion.delta, first.level, second.level)
        return self._settings.surfaces and self._surfaces.contradict(first.coarse, second.coarse, *moved)


def _together(features: Features, rows: Ints) -> Points:
    """The points of some features, with what is known of all of them together."""
    return sharing(features.points.taken(rows), features.pixels[rows])
