"""Expected sightings in compiled arrays, and the decision made by them, against the same in two calls."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest

from driven import make
from random_logs import random_log
from slamduel.backends._rules import CHEAPEST, JOINT, NEAREST, NEW, Decision, decide_frame, decision_by
from slamduel.backends.api import Expected
from slamduel.backends.association.quantiles import gates, quantile
from slamduel.backends.expected import as_expected, filled, fills, room_for
from slamduel.backends.gaussian.ekf import Ekf
from slamduel.bench.speed.world import world
from slamduel.core.factors import UNKNOWN, Odometry, RangeBearing, Step
from slamduel.core.se2 import Ints

FILL: dict[str, dict[str, Any]] = {
    "ekf": {},
    "ekf compressed": {"compress_above": 3},
    "ukf": {},
    "invariant-ekf": {},
    "smoother": {},
    "smoother robust": {"loss": "cauchy"},
}
MATCH, FAR, NODES, FIRST = quantile(0.99, 1), quantile(0.9999, 1), 2000, -7
GATES = gates(0.99, 30)


class Called(NamedTuple):
    """A decision."""

    names: list[int]
    new: int
    tried: int


def in_two_calls(rule: int, expected: Expected, seen: RangeBearing) -> Called:
    pair, tried = decide_frame(rule, seen.z, seen.cov, expected.z, expected.cov, MATCH, GATES, FAR, NODES)
    names, new = list[int](), 0
    for landmark in pair.tolist():
        names.append(FIRST - new if landmark == NEW else UNKNOWN if landmark < 0 else int(expected.ids[landmark]))
        new += landmark == NEW
    return Called(names, new, tried)


def decided(decision: Decision, sightings: int) -> Called:
    """The decision as it stands in the arrays, which are then made to say nothing."""
    named: Ints = decision.named
    said: Ints = decision.said
    found = Called(named[:sightings].tolist(), *said.tolist())
    named[:], said[:] = 0, -1
    return found


def decision_of(rule: int) -> Decision:
    decision = decision_by(rule, MATCH, GATES, FAR, NODES)
    first: Ints = decision.first
    first[0] = FIRST
    return decision


def asked(name: str) -> Iterator[tuple[Any, Step]]:
    """A backend at each step of a log, before the step, with what is sighted then."""
    log = random_log(np.random.default_rng(5), 60, 30, radius=4.0).log
    backend = make(name.partition(" ")[0], log.prior, **FILL[name])
    for step in log:
        if len(step.sightings.ids):
            yield backend, step
        backend.step(step)


def turned(seen: RangeBearing, angle: float) -> RangeBearing:
    z = seen.z + np.array((0.0, angle))
    z.flags.writeable = False  # as a log's
    return seen._replace(z=z)


@pytest.mark.parametrize("rule", [NEAREST, CHEAPEST, JOINT])
@pytest.mark.parametrize("name", FILL)
def test_the_decision_made_when_asked_is_that_of_asking_and_then_deciding(name: str, rule: int) -> None:
    """At the first step, where nothing is expected, at others, and with sightings that are of no landmark."""
    decision, into = decision_of(rule), room_for(1)
    into.decision[0] = decision.address
    known = new = 0
    for backend, step in asked(name):
        for angle in (0.0, 0.02, 2.0):
            seen = turned(step.sightings, angle)
            into = backend.expected_into(step.odometry, seen, FAR, into)
            found = decided(decision, len(seen.ids))
            assert found == in_two_calls(rule, backend.expected(step.odometry, seen, FAR), seen)
            known, new = known + sum(landmark >= 0 for landmark in found.names), new + found.new
    assert known > 50
    assert new > 20


@pytest.mark.parametrize("rule", [NEAREST, CHEAPEST, JOINT])
def test_what_is_filled_in_from_any_backend_is_decided_on_likewise(rule: int) -> None:
    decision, into = decision_of(rule), room_for(1)
    into.decision[0] = decision.address
    for backend, step in asked("ekf"):
        expected = backend.expected(step.odometry, step.sightings, FAR)
        into = filled(into, expected, step.sightings)
        assert decided(decision, len(step.sightings.ids)) == in_two_calls(rule, expected, step.sightings)


def test_an_answer_grows_and_is_the_same_as_what_is_expected() -> None:
    here = world(40, 5, 12, 1)
    for name in ("ekf", "ukf", "invariant-ekf", "smoother"):
        backend = make(name, here.prior)
        for step in here.survey:
            backend.step(step)
        step = here.drive[0]
        into = room_for(1)
        found = backend.expected_into(step.odometry, step.sightings, 18.4, into)
        assert found is not into
        for mine, other in zip(as_expected(found), backend.expected(step.odometry, step.sightings, 18.4), strict=True):
            assert len(mine) >= 12
            assert mine.tobytes() == other.tobytes()


def test_a_subclass_that_expects_otherwise_is_asked_in_its_own_way() -> None:
    class Other(Ekf):
        def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
            return super().expected(odometry, seen, gate)

    assert fills(object.__new__(Ekf))
    assert not fills(object.__new__(Other))
    assert not fills(object())
