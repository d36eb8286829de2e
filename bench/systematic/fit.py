"""Finds the systematic errors of logs, with intervals: by true paths, or by sightings and motions together.

Least squares over maps, errors and, where they are not known, paths. Intervals are a jackknife's over stretches of
time: noise may be misstated, and correlated for less than a stretch.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...backends.models import place
from ...core.factors import Log, Map, Truth
from ...core.se2 import Array, act, compose
from ...core.truth.doubts import judges
from ...core.truth.errors import named, rows_of
from ...datasets.noise.systematic import NAMES, Systematic
from ..measure.accuracy import align
from .estimated import Estimated
from .jackknife import estimates, solved, standard_errors
from .known_path import OnPath
from .reduced import Linear, Reduced
from .system import System

FEWEST = 200  # sightings of landmarks sighted before, below which nothing is fitted
LONGEST, LARGEST = 20_000, 1_000
"""Steps and landmarks that are looked at, from the log's first ones."""

ITERATIONS, WHOLE, SETTLED, ENOUGH = 40, 10, 0.02, 0.3
"""At most so many, the first ones whole and the others half: weights may let them go to and fro. Errors have settled
where each changes by less than that share of its standard error; after the last iteration, a larger one is enough."""

LEAST = 1e-9
"""Of standard errors, in their units: those of exact logs are 0."""

CERTAIN, ALONE, LIKELY = 4.0, 5.0, 2.5
"""Standard errors that an error is from 0 where it is said to be one: by chance once in 1,500; and where
neither a true path nor known places tell, as what nothing explains of the motion looks like an error of the sensor. One
that is likely is estimated beside those, as they would take its part; by a true path, which costs little, any one."""

ENTANGLED, INVOLVED = 20.0, 5.0
"""Times that others make the variance of an error larger, from which on it is not told apart from them, and from which
on it is one of these others."""

LAST = ("lag", "delay", "bearing_scale", "drift", "range_offset", "turn_scale", "wheel_scale", "yaw", "y", "x")
"""Errors that are given up where several are not told apart, the first one first."""

PLAUSIBLE = 0.1
"""Of the bearings' scale where nothing tells scales: what is more is no sensor's error, but the model's."""

GAUGES = ("range_scale", "heading", "lag")
"""Taken as 0 without a true path: ranges and the way are compared with each other alone, as are sensor and motion."""

VAGUE = Systematic(1.0, 1.0, 0.5, 1.0, 1.0, 0.3, 0.3, 0.3, 0.3, 0.5, 0.5, 1.0)
"""What is known to no better than this, as standard errors, is not told."""


class SystematicFit(NamedTuple):
    """The errors of logs, and what is known of them."""

    errors: Systematic  # those that are certain; 0 for others
    estimates: Mapping[str, Estimated]  # of all that are told; of others than the certain ones as if all were free
    by_truth: bool
    scaled: bool  # known, true places or paths tell the scale of ranges
    each: Mapping[int, Mapping[str, Estimated]] = {}  # by landmark, those of ranges alone

    @property
    def certain(self) -> Sequence[str]:
        """Names of those that are certain."""
        return [name for name in NAMES if getattr(self.errors, name)]


def of_truth(log: Log, truth: Truth | None) -> System | None:
    """The equations of a log by its true path; None where that, or what is sighted again, is too little."""
    if truth is None or len(truth.t) < 2 or not judges(log, truth):
        return None
    log = _looked_at(named(log, truth).identified())
    at = rows_of(truth.t, log.t)
    row = np.flatnonzero((at >= 0)[log.sighting_step])
    ids, first = np.unique(log.ids[row], return_index=True)
    if len(row) - len(ids) < FEWEST or not ((at[1:] >= 0) & (at[:-1] >= 0)).any():
        return None
    path, first = truth.poses[np.maximum(at, 0)], row[first]
    places = place(path[log.sighting_step[first]], log.z[first])[0]
    return System(log, path, Map(ids, places, None), True, at >= 0)


def of_estimate(log: Log, path: Array, landmarks: Map, places: Map | None = None) -> System | None:
    """The equations of a log around an estimate of its path (n, 3) and map; None where too little is sighted again.

    `path` and `landmarks` are of all steps and ids of the log, `places` those landmarks whose place is known.
    """
    log = _looked_at(log.identified().without_loops())
    if len(log.ids) - len(np.unique(log.ids)) < FEWEST:
        return None
    seen = np.isin(landmarks.ids, log.ids)
    landmarks = Map(landmarks.ids[seen], landmarks.xy[seen], None)
    known, path = np.ones(len(log), bool), path[: len(log)]
    if places is None:
        return System(log, path, landmarks, False, known)
    both = np.isin(places.ids, landmarks.ids)
    places = Map(places.ids[both], places.xy[both], None)
    motion = align(landmarks.xy[rows_of(landmarks.ids, places.ids)], places.xy).motion[None]
    xy = act(np.repeat(motion, len(landmarks.ids), axis=0), landmarks.xy)
    path = compose(np.repeat(motion, len(path), axis=0), path)
    return System(log, path, Map(landmarks.ids, xy, None), False, known, places)


def fitted(systems: Sequence[System]) -> SystematicFit | None:
    """Fits the errors that all systems have; None where nothing converges."""
    try:
        return _Fit(systems).result()
    except (np.linalg.LinAlgError, RuntimeError):  # a singular system, in NumPy and in SciPy
        return None


def _looked_at(log: Log) -> Log:
    """The log up to LONGEST steps and LARGEST landmarks."""
    _, first = np.unique(log.ids, return_index=True)
    steps = min(len(log), LONGEST)
    if len(first) > LARGEST:
        steps = min(steps, int(log.sighting_step[np.sort(first)[LARGEST]]))
    return log if steps == len(log) else log.head(steps)


@dataclass
class _Fit:
    systems: Sequence[System]
    errors: Systematic = field(default_factory=Systematic)

    def result(self) -> SystematicFit | None:
        by_truth = all(system.fixed for system in self.systems)
        scaled = by_truth or all(system.places is not None for system in self.systems)
        held = () if by_truth else GAUGES[1:] if scaled else GAUGES
        free = _told_apart(self._reduced(evenly=True), [name for name in NAMES if name not in held])
        if not self._settle(free):
            return None
        if not scaled and abs(self.errors.bearing_scale) > PLAUSIBLE:
            free.remove("bearing_scale")
            if not self._settle(free):
                return None
        joint = self._reduced()
        free = _told(joint, free)
        every = estimates(self.errors, joint, free)
        likely = free if by_truth else _sure(self.errors, joint, free, LIKELY)
        if not scaled and {"range_offset", "wheel_scale"} <= set(likely):
            likely[likely.index("wheel_scale")] = "range_scale"  # ranges that are off are so in scale as well
            every.pop("wheel_scale")
        if not self._settle(likely):
            return None
        joint = self._reduced()
        found = estimates(self.errors, joint, likely)
        certain = _sure(self.errors, joint, likely, CERTAIN if scaled else ALONE)
        errors = Systematic(**{name: getattr(self.errors, name) for name in certain})
        return SystematicFit(errors, every | found, by_truth, scaled)

    def _settle(self, free: Sequence[str]) -> bool:
        """Iterates until the errors no longer change, with those that are not free at 0; False where they go on."""
        self._change(np.array([0.0 if name in free else -getattr(self.errors, name) for name in NAMES]))
        change = size = np.ones(len(NAMES))
        for k in range(ITERATIONS):
            linear, joint = self._linear()
            change = solved(joint.H, joint.g, free)
            if not np.isfinite(change).all() or (np.abs(change) > 10 * np.array(VAGUE)).any():
                return False
            self._change(change, linear, 1.0 if k < WHOLE else 0.5)
            size = _sizes(joint, free)
            if (np.abs(change) <= SETTLED * size).all():
                return True
        return bool((np.abs(change) <= ENOUGH * size).all())

    def _change(self, by: Array, linear: Sequence[Linear | OnPath] | None = None, share: float = 1.0) -> None:
        if linear is None and not by.any():
            return
        for one, system in zip(linear or self._linear()[0], self.systems, strict=True):
            system.move(share * one.change(by))
        self.errors = Systematic(*(np.array(self.errors) + share * by).tolist())

    def _linear(self, *, evenly: bool = False) -> tuple[list[Linear | OnPath], Reduced]:
        linear = [(OnPath if one.fixed else Linear)(one, self.errors, evenly=evenly) for one in self.systems]
        return linear, _together([one.reduced() for one in linear])

    def _reduced(self, *, evenly: bool = False) -> Reduced:
        return self._linear(evenly=evenly)[1]


def _together(parts: Sequence[Reduced]) -> Reduced:
    """The equations of several logs, and without each stretch of one."""
    H, g = sum(one.H for one in parts), sum(one.g for one in parts)
    return Reduced(
        np.asarray(H),
        np.asarray(g),
        np.concatenate([H - one.H + one.H_without for one in parts]),
        np.concatenate([g - one.g + one.g_without for one in parts]),
    )


def _sizes(joint: Reduced, free: Sequence[str]) -> Array:
    """(p,) what matters of each error: its standard error, or what is told of it at all."""
    return np.maximum(standard_errors(joint, free), 1e-7)


def _told_apart(joint: Reduced, free: Sequence[str]) -> list[str]:
    """The errors of `free` of which the equations tell one from another."""
    free = [name for name in free if joint.H[NAMES.index(name), NAMES.index(name)] > 1 / getattr(VAGUE, name) ** 2]
    while free:
        at = np.array([NAMES.index(name) for name in free])
        H = joint.H[np.ix_(at, at)]
        size = np.sqrt(np.diag(H))
        inflated = np.diag(np.linalg.inv(H / np.outer(size, size) + 1e-12 * np.eye(len(at))))
        if inflated.max() <= ENTANGLED:
            break
        entangled = {name for name, one in zip(free, inflated, strict=True) if one > INVOLVED}
        free.remove(next((name for name in LAST if name in entangled), next(iter(entangled))))
    return free


def _told(joint: Reduced, free: Sequence[str]) -> list[str]:
    """The errors of `free` that are known to better than VAGUE."""
    size = standard_errors(joint, free)
    return [name for name in free if size[NAMES.index(name)] < getattr(VAGUE, name) / CERTAIN]


def _sure(errors: Systematic, joint: Reduced, free: Sequence[str], least_ratio: float) -> list[str]:
    """Those of `free` so many standard errors from 0, the others estimated: the least one is left out first."""
    free = list(free)
    while free:
        at = solved(joint.H, joint.g - joint.H @ np.array(errors), free)
        ratio = {name: abs(at[NAMES.index(name)]) for name in free}
        size = standard_errors(joint, free)
        ratio = {name: value / max(size[NAMES.index(name)], LEAST) for name, value in ratio.items()}
        least = min(free, key=ratio.__getitem__)
        if ratio[least] >= least_ratio:
            break
        free.remove(least)
    return free
