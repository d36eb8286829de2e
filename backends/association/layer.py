"""Data association in front of a backend: it makes up the ids of sightings, and the backend gets an ordinary step.

The backend states which landmarks it expects to see, and with what joint covariance; a rule decides which of them each
sighting without an id is of; one that is of none is of a new landmark. Rule, gates and code are the same for every
backend. Ids that are known are left as they are. Made-up ids are -2, -3, ...: never the number of a real landmark.
"""

import dataclasses
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ...frontend.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, Step, Truth
from ...frontend.se2 import Array, Ints
from ..api import Backend, Belief, Builder, Expected, Expects, Pose, Solution, Unsuited, WantsTruth
from ._rules import OPEN, decide_frame
from .newborn import Newborn
from .options import RULES, options_with

FIRST = -2
"""The first made-up id; the next ones are below it."""

LARGEST = 64
"""Pairs that a joint gate is tabulated for at first."""


class Associating:
    """A backend behind data association."""

    def __init__(self, inner: Backend, options: Any) -> None:
        self._inner: Any = inner
        self._rule = RULES.index(options.association)
        self._match, self._far = quantile(options.match, 1), quantile(options.new, 1)
        self._share, self._gates = options.joint, gates(options.joint, LARGEST)
        self._most = options.nodes
        self._next = FIRST
        self._sure: list[int] = []  # the landmark of every sighting so far
        self._now = np.zeros(0, np.int64)  # of those of the last step
        self._newborn = Newborn(options.confirm, options.within, self._match) if options.confirm else None
        self._retire = options.retire
        self._once: dict[int, int] = {}  # landmark sighted once -> the number of the step with sightings
        self._retired: set[int] = set()
        self._looks = 0  # steps with sightings
        self.ns: list[int] = []  # CPU time of association, each step
        self.tried: list[int] = []  # pairs or nodes of the search, each step

    def step(self, step: Step) -> Pose | None:
        """Decides which landmark each sighting without an id is of, then hands the step on."""
        ids, z, cov = step.sightings
        named = ids.tolist()
        if UNKNOWN not in named:
            if self._newborn is not None:
                self._newborn.move(step.odometry)
            self._now = ids
            self._sure += named
            self.ns.append(0)
            self.tried.append(0)
            return self._inner.step(step)
        start = time.process_time_ns()
        nodes = self._name(step, named)
        self._now = np.array(named, np.int64)
        self._sure += named
        if UNKNOWN in named:
            used = self._now != UNKNOWN
            step = step._replace(sightings=RangeBearing(self._now[used], z[used], cov[used]))
        else:
            step = step._replace(sightings=RangeBearing(self._now, z, cov))
        self.ns.append(time.process_time_ns() - start)
        self.tried.append(nodes)
        return self._inner.step(step)

    def belief(self) -> Belief | None:
        """The backend's, and the landmark that each sighting of the last step was taken for."""
        found = self._inner.belief()
        return None if found is None else found._replace(assigned=self._now.copy())

    def map(self) -> Map:
        """The backend's, without landmarks that were taken out."""
        return self._without_retired(self._inner.map())

    def finish(self) -> Solution | None:
        """The backend's, without landmarks that were taken out."""
        found = self._inner.finish()
        return None if found is None else found._replace(map=self._without_retired(found.map))

    def assigned(self) -> Ints:
        """(s,) the landmark of every sighting so far; UNKNOWN for one that is not used."""
        return np.array(self._sure, np.int64)

    def tell(self, truth: Truth) -> bool:
        """Hands the ground truth on to a backend that asks for it."""
        return isinstance(self._inner, WantsTruth) and self._inner.tell(truth)

    def _name(self, step: Step, named: list[int]) -> int:
        """Replaces UNKNOWN in `named`, where it is decided; returns the pairs or nodes tried."""
        seen = step.sightings
        expected = self._expected(step.odometry, seen, named)
        if len(named) >= len(self._gates):
            self._gates = gates(self._share, 2 * len(named))
        open_ = [i for i, name in enumerate(named) if name == UNKNOWN]
        z, cov = seen.z, seen.cov
        if len(open_) < len(named):
            z, cov = z[open_], cov[open_]
        pair, nodes = decide_frame(
            self._rule, z, cov, expected.z, expected.cov, self._match, self._gates, self._far, self._most
        )
        known, new = expected.ids.tolist(), list[int]()
        for i, landmark in zip(open_, pair.tolist(), strict=True):
            if landmark >= 0:
                named[i] = known[landmark]
            elif landmark != OPEN:
                new.append(i)
        if self._newborn is not None:
            self._confirm(step, named, new)
        else:
            for i in new:
                named[i] = self._next
                self._next -= 1
        if self._retire:
            self._forget(named, {named[i] for i in new})
        return nodes

    def _expected(self, odometry: Odometry | None, seen: RangeBearing, named: list[int]) -> Expected:
        """What the backend expects, without landmarks that were taken out or that a sighting with an id is of."""
        expected = self._inner.expected(odometry, seen, self._far)
        out = self._retired.union(named) if self._retired else named
        keep = [k for k, landmark in enumerate(expected.ids.tolist()) if landmark not in out]
        if len(keep) == len(expected.ids):
            return expected
        entries = np.repeat(2 * np.array(keep, np.int64), 2)
        entries[1::2] += 1
        return Expected(expected.ids[keep], expected.z[keep], expected.cov[np.ix_(entries, entries)])

    def _confirm(self, step: Step, named: list[int], new: list[int]) -> None:
        """Makes landmarks of those of the `new` sightings that earlier ones agree with."""
        assert self._newborn is not None
        self._newborn.move(step.odometry)
        first = len(self._sure)
        born = self._newborn.sighted(step.sightings.z[new], step.sightings.cov[new], [first + i for i in new])
        for i, rows in zip(new, born, strict=True):
            if rows is not None:
                named[i] = self._next
                for row in rows[:-1]:
                    self._sure[row] = self._next
                self._next -= 1

    def _forget(self, named: list[int], new: set[int]) -> None:
        """Takes out landmarks that were sighted once, long ago: a first sighting says nothing of the pose."""
        self._looks += 1
        for landmark in named:
            if landmark in new:
                self._once[landmark] = self._looks
            else:
                self._once.pop(landmark, None)
        for landmark in list(self._once):  # in the order of their sightings
            if self._looks - self._once[landmark] <= self._retire:
                break
            del self._once[landmark]
            self._retired.add(landmark)

    def _without_retired(self, found: Map) -> Map:
        if not self._retired:
            return found
        keep = np.flatnonzero(~np.isin(found.ids, list(self._retired)))
        entries = np.stack((2 * keep, 2 * keep + 1), axis=1).ravel()
        cov = None if found.cov is None else found.cov[np.ix_(entries, entries)]
        return Map(found.ids[keep], found.xy[keep], cov)


def associating(builder: Builder) -> Builder:
    """A builder of the same backend with the options of data association; itself where it cannot have it."""
    if not (builder.expects or _expects(builder.make)):
        return builder

    def make(prior: Prior, options: Any, rng: np.random.Generator) -> Backend:
        inner = builder.make(prior, options, rng)
        if options.association == "none":
            return inner
        if not isinstance(inner, Expects):
            raise Unsuited("with these options the backend cannot state what it expects to see: no association")
        if prior.map is not None and prior.map.cov is None:
            raise Unsuited("data association needs the covariance of the given map, which has none")
        return Associating(inner, options)

    make.__doc__ = builder.make.__doc__
    associates: Callable[[Any], bool] = lambda options: options.association != "none"  # noqa: E731
    return dataclasses.replace(builder, make=make, options=options_with(builder.options), associates=associates)


def _expects(make: object) -> bool:
    """Tells if what makes a backend is a class with the method that data association needs."""
    return isinstance(make, type) and issubclass(make, Expects)


def gates(share: float, most: int) -> Array:
    """Joint gates of 0 to `most` pairs, (most + 1,)."""
    return np.array([0.0, *(quantile(share, pairs) for pairs in range(1, most + 1))])


def quantile(share: float, pairs: int) -> float:
    """The chi-square quantile of a joint distance of that many pairs, two degrees of freedom each."""
    if pairs == 1:
        return -2.0 * math.log1p(-share)
    from scipy.stats import chi2

    return float(chi2.ppf(share, 2 * pairs))
