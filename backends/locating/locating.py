"""A backend whose start on the given map is not known, or whose robot is carried elsewhere, in front of any backend.

Steps are held until the robot is found on the map; then the backend is made with the pose found, that of the last step.
Steps before it are not taken again: with data association they would be named from a pose that odometry leads back to.
From there on the sightings are watched. Where they have become likelier by chance than at the pose, the robot is
looked for again, by the sightings since, and the backend is made anew where it is found elsewhere.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.errors import SlamduelError
from ...core.factors import UNKNOWN, Map, Prior, RelativePoses, Step, Truth
from ...core.se2 import Array, Ints, compose, inverse, wrap
from ..api import (
    Associates,
    AssociatesPartial,
    Backend,
    Belief,
    Builder,
    Calibrates,
    Calibration,
    Pose,
    Solution,
    TakenOut,
    TakesOut,
    WantsTruth,
)
from .locate import LEAST, Fix, locate
from .map_index import indexed
from .watch import Watch

WINDOW = 128  # steps with sightings that the robot is looked for by, at most
TWICE = 2.0
"""The covariance of a pose found is multiplied by this: the sightings of its step are used for it, and again by the
backend."""
SAME = 0.5
"""rad: a pose found is the one believed where headings differ by less, and places by less than landmarks do."""


def begin(builder: Builder, prior: Prior, options: Any, rng: np.random.Generator) -> Backend:
    """Makes a backend; one that cannot find an unknown start itself is put behind `Locating`."""
    if prior.start == "known" or prior.map is None or builder.locates:
        return builder.make(prior, options, rng)
    return Locating(
        lambda found: builder.make(found, options, rng), prior, prior.map, online=builder.is_online(options)
    )


class Locating:
    """Looks for the robot on the map, and makes the backend where it finds it."""

    def __init__(self, make: Callable[[Prior], Backend], prior: Prior, known: Map, *, online: bool) -> None:
        self._make, self._prior, self._map = make, prior, known
        self._on = indexed(known) if len(known.ids) else None
        self._watch = None if self._on is None else Watch(self._on)
        self._truth: Truth | None = None
        self._inner: Backend | None = None
        self._first = 0  # step at which the inner backend starts
        self._online = online
        self._held: list[Step] = []  # the last steps, from one with sightings on
        self._seeing = 0  # of these steps
        self._delta = list[Array]()  # (3,) of every step
        self._parts = list[tuple[int, Array]]()  # first steps and smoothed paths of backends that have been given up
        self._pose = prior.pose.copy()
        self._sighted = self._sighted_partial = 0  # sightings so far
        self._asked = 0  # sightings when it was last looked for

    def tell(self, truth: Truth) -> bool:
        """Takes the ground truth for a backend that asks for it."""
        self._truth = truth
        return self._told(self._make(self._prior))

    def step(self, step: Step) -> Pose | None:
        """Takes a step; the pose before the robot is found is the prior's, and odometry from there."""
        self._sighted += len(step.sightings.ids)
        self._sighted_partial += len(step.partial.ids)
        self._delta.append(np.zeros(3) if step.odometry is None else step.odometry.delta)
        before, self._pose = self._pose, compose(self._pose, self._delta[-1])
        self._hold(step)
        if not self._found(before, step) and self._inner is not None:
            pose = self._inner.step(_shifted(step, self._first))
            if self._online and pose is None:
                raise SlamduelError("step() returned None, expected a pose; a batch method is one with online=False")
            self._pose = self._pose if pose is None else pose
        return self._pose.copy() if self._online else None

    def belief(self) -> Belief | None:
        """The backend's belief; before there is a backend, not located and without covariance."""
        if self._inner is None:
            return Belief(self._pose.copy(), located=False)
        return self._inner.belief() or Belief(self._pose.copy())

    def map(self) -> Map:
        """That of the backend; the given one before there is one."""
        return self._map if self._inner is None else self._inner.map()

    def assigned(self) -> Ints | None:
        """The landmark of every sighting so far, by a backend with data association; UNKNOWN before its start."""
        if not isinstance(self._inner, Associates):
            return None
        found = self._inner.assigned()
        return np.concatenate((np.full(self._sighted - len(found), UNKNOWN), found))

    def assigned_partial(self) -> Ints | None:
        """Likewise of every partial sighting."""
        found = self._inner.assigned_partial() if isinstance(self._inner, AssociatesPartial) else None
        return None if found is None else np.concatenate((np.full(self._sighted_partial - len(found), UNKNOWN), found))

    def taken_out(self) -> TakenOut | None:
        """The measurements that the backend has taken out since its start, if it does."""
        return self._inner.taken_out() if isinstance(self._inner, TakesOut) else None

    def calibration(self) -> Calibration:
        """The backend's since its start."""
        return self._inner.calibration() if isinstance(self._inner, Calibrates) else Calibration()

    def finish(self) -> Solution | None:
        """The backend's; where there was none yet, the path that odometry leads back on from its start."""
        if self._inner is None:
            return None
        solution = self._inner.finish()
        if solution is None:
            return None
        path, begins = solution.path, self._first
        for first, part in reversed([(0, np.zeros((0, 3))), *self._parts]):
            path = np.concatenate((part, self._led_back(path[0], first + len(part), begins), path))
            begins = first
        cov = solution.cov
        if cov is not None:
            cov = np.concatenate((np.full((len(path) - len(cov), 3, 3), np.nan), cov))
        return solution._replace(path=path, cov=cov)

    def _hold(self, step: Step) -> None:
        """Holds the last steps with `WINDOW` that have sightings, from one of these on."""
        if not self._held and not len(step.sightings.ids):
            return
        self._held.append(step)
        self._seeing += bool(len(step.sightings.ids))
        while self._seeing > WINDOW or not len(self._held[0].sightings.ids):
            self._seeing -= bool(len(self._held.pop(0).sightings.ids))

    def _found(self, before: Array, step: Step) -> bool:
        """Returns True where the backend is made anew, and has taken the step; the last pose was `before`."""
        if self._inner is None or self._watch is None:
            return self._look(self._held)
        if self._online:
            self._watch.step(before, step)
        return self._watch.lost and self._look(self._held[-self._watch.since :])

    def _look(self, steps: list[Step]) -> bool:
        """Looks for the robot by these last steps, once their sightings are an eighth more than the last time."""
        if self._on is None or not steps or not len(steps[-1].sightings.ids):
            return False
        self._asked += len(steps[-1].sightings.ids)
        many = sum(len(one.sightings.ids) for one in steps)
        if many < LEAST or 8 * self._asked < many:
            return False
        self._asked = 0
        fix = locate(steps, self._on)
        elsewhere = fix is not None and (self._inner is None or self._elsewhere(fix))
        if fix is not None and elsewhere:
            self._start(fix, steps)
        if fix is not None and self._watch is not None:
            self._watch.reset()
        return elsewhere

    def _elsewhere(self, fix: Fix) -> bool:
        """Returns True where the pose found is another place than the one believed."""
        gap = self._on.cell if self._on is not None else 0.0
        off = fix.pose - self._pose
        return bool(np.hypot(off[0], off[1]) > gap or abs(wrap(off[2])) > SAME)

    def _start(self, fix: Fix, steps: list[Step]) -> None:
        """Makes the backend with the pose found at the last of the steps, and gives it that one."""
        now = len(self._delta) - 1
        if self._inner is not None:
            given_up = self._inner.finish()
            if given_up is not None:
                self._parts.append((self._first, given_up.path[: max(0, now + 1 - len(steps) - self._first)]))
        self._first = now
        self._inner = self._make(self._prior._replace(pose=fix.pose, cov=TWICE * fix.cov, start="known"))
        self._told(self._inner)
        answer = self._inner.step(_shifted(steps[-1]._replace(odometry=None), now))
        self._pose = fix.pose.copy() if answer is None else answer

    def _led_back(self, pose: Array, begin: int, end: int) -> Array:
        """The poses of the steps from `begin` to before `end`, by the odometry from that `pose` at `end`."""
        back = [pose]
        for delta in reversed(self._delta[begin + 1 : end + 1]):
            back.append(compose(back[-1], inverse(delta)))
        return np.array(back[:0:-1]).reshape(-1, 3)

    def _told(self, backend: Backend) -> bool:
        return self._truth is not None and isinstance(backend, WantsTruth) and backend.tell(self._truth)


def _shifted(step: Step, first: int) -> Step:
    """The step with its loop closures counted from step `first`; those to earlier steps are left out."""
    if not first or not len(step.loops.to):
        return step
    to, delta, cov = step.loops
    here = to >= first
    return step._replace(loops=RelativePoses(to[here] - first, delta[here], cov[here]))
