"""Loop closures: earlier keyframes that a new one is registered with."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..maps.cloud import NOTHING
from .pairs import Keyframe, Pair, Pairs, Trial
from .planar import Planar, distance, floors
from .settings import Settings
from .ways import Ways, joined
from .words import Words

LOOSE, LOOSE_TURN = 0.3, 0.2
"""sd, m and rad, of the motion along the steps from which on it refuses too little: two loops have to agree then."""

WAITING = 20  # steps that a loop waits for another one that agrees


class Loops:
    """The keyframes that loops are searched in: one in so many metres, and none where one is known already."""

    def __init__(self, pairs: Pairs, ways: Ways, settings: Settings, wheels: bool) -> None:
        self._pairs, self._ways, self._settings = pairs, ways, settings
        self._least = settings.loop_inliers if wheels else settings.loop_inliers_alone
        self._shared = np.diag([settings.loop_floor**2, settings.loop_floor**2, settings.loop_turn_floor**2])
        self._places: list[Keyframe] = []
        self._words = Words(settings)
        self._waiting: list[Pair] = []
        self.searched, self.why, self.trials = 0, Counter[str](), list[Trial]()  # of the last search

    @property
    def places(self) -> Sequence[Keyframe]:
        """The keyframes that loops are searched in."""
        return self._places

    def search(self, frame: Keyframe) -> list[Pair]:
        """The loops that a keyframe closes, those by most features first, and those that waited for it."""
        found = list[Pair]()
        self.trials = []
        for place in self._candidates(frame):
            self.searched += 1
            known = partial(self._ways.motion, place.step, frame.step)
            trial = self._pairs.register(place, frame, self._least, known)
            self.trials.append(trial)
            pair = trial.pair
            if pair is None:
                self.why[trial.reason] += 1
            elif self._small(pair.motion):
                self.why["the view in common is too small"] += 1
            else:
                found.append(pair._replace(motion=pair.motion._replace(cov=pair.motion.cov + self._shared)))
        found.sort(key=lambda pair: -len(pair.rows))
        return [closed for pair in found[: self._settings.loops_a_step] for closed in self._confirmed(pair)]

    def remember(self, frame: Keyframe, loops: Sequence[Pair]) -> None:
        """Makes a keyframe a place, unless the last place or one that it closes a loop to is close by."""
        s = self._settings
        near = [pair.motion for pair in loops if pair.second is frame]
        if self._places:
            near.append(self._ways.motion(self._places[-1].step, frame.step))
        if not any(np.hypot(*one.delta[:2]) < s.place_step and abs(one.delta[2]) < s.place_turn for one in near):
            self._places.append(replace(frame, cloud=NOTHING))
            self._words.add(self._places)

    def _candidates(self, frame: Keyframe) -> list[Keyframe]:
        """The places to search: all that are old enough, or those whose words are alike."""
        s = self._settings
        old = [k for k, place in enumerate(self._places) if frame.t - place.t > s.loop_after]
        if len(old) > s.by_words:
            old = self._words.best(frame.features.descriptors, old, s.candidates)
        return [self._places[k] for k in old]

    def _small(self, motion: Planar) -> bool:
        """Tells if the features leave the turn so open that errors which they share would move it beyond its sd."""
        s = self._settings
        return motion.cov[2, 2] - floors(motion.delta, s)[2, 2] > s.loop_weak_turn**2

    def _confirmed(self, pair: Pair) -> list[Pair]:
        """The loop, with one that it agrees with where the steps cannot tell if it is right; none while it waits."""
        s = self._settings
        known = self._ways.motion(pair.first.step, pair.second.step)
        sd = np.sqrt(np.diag(known.cov))
        if max(sd[0], sd[1]) < LOOSE and sd[2] < LOOSE_TURN:
            return [pair]
        self._waiting = [one for one in self._waiting if pair.second.step - one.second.step <= WAITING]
        for one in self._waiting:
            if one.second is not pair.second and distance(pair.motion, self._around(pair, one)) < s.wheels_gate:
                self._waiting.remove(one)
                return [one, pair]
        self._waiting.append(pair)
        self.why["no other loop agrees"] += 1
        return []

    def _around(self, pair: Pair, other: Pair) -> Planar:
        """The motion that a loop should have by another: to the other's place, along it, and back on the last steps."""
        before = self._ways.motion(pair.first.step, other.first.step)
        return joined([before, other.motion, self._ways.motion(other.second.step, pair.second.step)])
