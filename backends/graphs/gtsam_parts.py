"""Partial sightings, fixes and constant errors as GTSAM's factors: native ones where the wheel has some.

GTSAM's derivatives by a pose are in the pose's own frame: those of Python's factors are turned into it here.
"""

import math
from collections.abc import Callable

import gtsam
import numpy as np

from ...core.factors import Systematic
from ...core.fixes import Fixes, residual
from ...core.gyro import Bias, Turn
from ...core.partial import RANGE
from ...core.se2 import Array, Ints, rotation
from ..api import Constant
from ..constant_errors import stated
from ..starting.late_places import Seen

FAILURES = (RuntimeError, ValueError, IndexError)
"""GTSAM's exceptions in Python."""

HELD = 1e-6
"""Standard deviation that holds a constant error at zero: of the two that are one variable, the prior has one."""

FIRST_ERRORS, HEADING, FIRST_BIAS = gtsam.symbol("e", 0), gtsam.symbol("h", 0), gtsam.symbol("g", 0)
"""Keys of the constant errors of ranges, (scale, offset), of that of a heading, and of a gyro's biases, (value, 0)."""

BY_BEFORE, BY_AFTER = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]])
"""A turn's derivatives by the poses before and after it, in their own frames."""

Weighed = Callable[[gtsam.noiseModel.Base], gtsam.noiseModel.Base]


class ConstantKeys:
    """Names the constant errors' variables, which enter a graph, with their priors, before the first factor of each."""

    def __init__(self, sds: Systematic) -> None:
        self._sds, self._ranges = sds, sds.range_scale > 0 or sds.range_offset > 0
        self._keys = dict[int, int]()  # of landmarks, or of all as -1
        self._turns = False

    @property
    def used(self) -> bool:
        """True if a graph has some."""
        return self._turns or len(self._keys) > 0

    @property
    def all(self) -> list[int]:
        """The keys of those in a graph."""
        return [*self._keys.values(), *[HEADING] * self._turns]

    def of(self, landmark: int, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> int | None:
        """The key of the errors of ranges to a landmark, which is added where it is new; None without any."""
        if not self._ranges:
            return None
        name = landmark if self._sds.each else -1
        if name not in self._keys:
            key = self._keys[name] = FIRST_ERRORS + len(self._keys)
            _add(key, (self._sds.range_scale or HELD, self._sds.range_offset or HELD), graph, values)
        return self._keys[name]

    def heading(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> int | None:
        """Likewise of headings."""
        if not self._sds.heading_offset > 0:
            return None
        if not self._turns:
            self._turns = True
            _add(HEADING, (self._sds.heading_offset, 1.0), graph, values)
        return HEADING

    def read(
        self, landmarks: Ints, values: gtsam.Values, cov_of: Callable[[int], Array] | None = None
    ) -> Constant | None:
        """The constant errors of these landmarks; None without any.

        `cov_of` gives the covariance of one by its key; their standard deviations are not known where it fails.
        """
        if not self.used:
            return None
        names = landmarks.tolist() if self._sds.each else [-1]
        keys = [self._keys.get(name) for name in names]
        found = np.array([np.zeros(2) if key is None else values.atPoint2(key) for key in keys]).reshape(-1, 2)
        turn = float(values.atPoint2(HEADING)[0]) if self._turns else 0.0
        sds = None
        if cov_of is not None:
            of_one = cov_of

            def joint(of: Ints) -> Array | None:
                try:
                    return np.diag(np.concatenate([np.diagonal(of_one(key)) for key in of.tolist()]))
                except FAILURES:
                    return None

            there = [*(-1 if key is None else key for key in keys), HEADING if self._turns else -1]
            first = [self._sds.range_scale, self._sds.range_offset]
            sds = stated(joint, there, [*[first] * len(keys), [self._sds.heading_offset, 0.0]])
        return Constant(found[:, 0], found[:, 1], turn, sd=sds)


def part_factor(pose: int, landmark: int, errors: int | None, seen: Seen, weighed: Weighed) -> gtsam.NonlinearFactor:
    """The factor of a partial sighting, a range with the constant errors of key `errors`, if any."""
    model = weighed(gtsam.noiseModel.Isotropic.Sigma(1, math.sqrt(seen.var)))
    if seen.kind != RANGE:
        return gtsam.BearingFactor2D(pose, landmark, gtsam.Rot2(seen.z), model)
    if errors is None:
        return gtsam.RangeFactor2D(pose, landmark, seen.z, model)

    def off(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None) -> Array:
        del this
        at, (scale, offset) = values.atPose2(pose), values.atPoint2(errors)
        away = values.atPoint2(landmark) - at.translation()
        distance = math.hypot(*away.tolist())
        if jacobians is not None:
            way = (1 + scale) * away / distance
            jacobians[0] = np.append(-way @ at.rotation().matrix(), 0.0)[None]
            jacobians[1], jacobians[2] = way[None], np.array([[distance, 1.0]])
        return np.array([(1 + scale) * distance + offset - seen.z])

    return gtsam.CustomFactor(model, [pose, landmark, errors], off)


def fix_factors(pose: int, turn: int | None, fixes: Fixes) -> list[gtsam.NonlinearFactor]:
    """The factors of a step's fixes, headings with the constant error of key `turn`, if any."""
    return [_fix_factor(pose, turn, *one) for one in zip(*fixes, strict=True)]


def _fix_factor(pose: int, turn: int | None, z: Array, cov: Array, arm: Array) -> gtsam.NonlinearFactor:
    measured = np.flatnonzero(~np.isnan(z))
    model = gtsam.noiseModel.Gaussian.Covariance(cov[np.ix_(measured, measured)])
    constant = turn if 2 in measured else None
    if constant is None and not arm.any() and measured.tolist() == [0, 1]:
        return gtsam.PoseTranslationPrior2D(pose, z[:2], model)

    def off(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None) -> Array:
        del this
        at = values.atPose2(pose)
        error = 0.0 if constant is None else values.atPoint2(constant)[0]
        here = np.array((at.x(), at.y(), at.theta()))
        away, jacobian = residual(here, z - np.array((0.0, 0.0, error)), arm)
        if jacobians is not None:
            jacobians[0] = np.asfortranarray((jacobian @ rotation(here[2]))[measured])
            if constant is not None:
                jacobians[1] = np.asfortranarray(np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])[measured])
        return -away[measured]

    return gtsam.CustomFactor(model, [pose] if constant is None else [pose, constant], off)


class GyroBiases:
    """The biases of a gyro, another one where the bias has moved, with their prior and their walk."""

    def __init__(self, prior: Bias) -> None:
        self._prior = prior
        self.last: int | None = None
        """The key of the last one; None before the first turn."""

    def add(
        self, pose: int, turn: Turn, now: Bias | None, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values
    ) -> None:
        """Adds the turn to the pose of key `pose` from the one before; a new bias starts at what it is `now`."""
        first, at = self.last is None, np.array(((now or self._prior).mean, 0.0))
        if self.last is None:
            self.last = FIRST_BIAS
            sd = max(math.sqrt(self._prior.sd**2 + turn.walk), HELD)
            model = gtsam.noiseModel.Diagonal.Sigmas(np.array((sd, 1.0)))
            graph.add(gtsam.PriorFactorPoint2(self.last, np.array((self._prior.mean, 0.0)), model))
        elif turn.walk > 0:
            self.last += 1
            model = gtsam.noiseModel.Diagonal.Sigmas(np.array((math.sqrt(turn.walk), 1.0)))
            graph.add(gtsam.BetweenFactorPoint2(self.last - 1, self.last, np.zeros(2), model))
        if first or turn.walk > 0:
            values.insert(self.last, at)
        graph.add(_turn_factor(pose, self.last, turn))


def _turn_factor(pose: int, bias: int, turn: Turn) -> gtsam.NonlinearFactor:
    by_bias = np.array([[turn.dt, 0.0]])

    def off(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None) -> Array:
        del this
        before, after = values.atPose2(pose - 1).theta(), values.atPose2(pose).theta()
        if jacobians is not None:
            jacobians[0], jacobians[1], jacobians[2] = BY_BEFORE, BY_AFTER, by_bias
        away = after - before + turn.dt * float(values.atPoint2(bias)[0]) - turn.turn
        return np.array([math.remainder(away, math.tau)])

    model = gtsam.noiseModel.Isotropic.Sigma(1, math.sqrt(turn.var))
    return gtsam.CustomFactor(model, [pose - 1, pose, bias], off)


def _add(key: int, sds: tuple[float, float], graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """Adds constant errors and their prior."""
    graph.add(gtsam.PriorFactorPoint2(key, np.zeros(2), gtsam.noiseModel.Diagonal.Sigmas(np.array(sds))))
    values.insert(key, np.zeros(2))
