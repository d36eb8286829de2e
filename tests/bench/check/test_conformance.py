"""The suite behind `bench check`: a sound backend passes, and each fault is caught by the check that is meant to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from broken_backends import ADVERSE, BROKEN, Sound
from slamduel.backends import registry
from slamduel.backends.api import Backend, Belief, Builder, Map, Pose, Prior, Step, option
from slamduel.bench.check.candidate import Candidate, Failed, stays_near
from slamduel.bench.check.contract import BLIND
from slamduel.bench.check.small_logs import IDS, NO_SIGHTINGS, around, behind, dead_reckoned, drive, with_loop, with_map
from slamduel.bench.check.suite import ADVERSARIAL, CHECKS, QUICK, Check, Outcome, check, chosen, examine
from slamduel.core.se2 import compose


@dataclass(frozen=True)
class Undescribed:
    gain: float = 1.0


def build(make: Callable[..., Backend], **how: Any) -> Builder:
    return Builder(make, **how)


def outcome(builder: Builder, name: str) -> Outcome:
    check = next(check for check in CHECKS if check.name == name)
    return examine(check, Candidate(builder, builder.options()))


def test_a_sound_backend_passes_everything() -> None:
    outcomes = check(build(Sound))
    assert [found for found in outcomes if found.status == "failed"] == []
    assert {found.name for found in outcomes if found.status == "not applicable"} == {
        "unknown-landmarks-are-told-apart",
        "asking-what-is-expected-changes-nothing",
        "loop-closures-are-used",
        "loop-closures-and-sightings-go-together",
        "halves-of-sightings-count-as-whole-ones",
        "a-position-each-second-is-used",
        "constants-are-near-the-truth",
    }
    assert len({found.name for found in outcomes}) == len(QUICK) == len(outcomes)
    assert all(found.title.endswith(".") and found.found for found in outcomes)


@pytest.mark.parametrize(("broken", "name", "found"), BROKEN, ids=lambda value: getattr(value, "__name__", None))
def test_each_fault_is_caught_where_it_should_be(broken: type[Sound], name: str, found: str) -> None:
    result = outcome(build(broken), name)
    assert (result.status, found in result.found) == ("failed", True), result


def test_factors_that_are_taken_and_not_used_are_caught() -> None:
    class Unused(Sound):
        """Leaves out what it says it takes."""

        def step(self, step: Step) -> Pose | None:
            return super().step(step._replace(sightings=NO_SIGHTINGS))

    for name in ("halves-of-sightings-count-as-whole-ones", "a-position-each-second-is-used"):
        result = outcome(build(Unused, partial=True, fixes=True), name)
        assert (result.status, "expected less than half of odometry's" in result.found) == ("failed", True), result


def test_a_maker_without_help_is_caught() -> None:
    class Undocumented(Sound):
        pass

    assert "summary" in outcome(build(Sound, options=Undescribed), "options-are-described").found
    assert "frozen dataclass" in outcome(build(Sound, options=dict), "options-are-described").found
    assert "docstring" in outcome(build(Undocumented), "options-are-described").found


def test_whether_it_works_online_is_said_by_its_builder() -> None:
    assert "the Builder says online=False" in outcome(build(Sound, online=False), "answers-have-their-types").found
    batch, name = registry.find("graph"), "answers-have-their-types"
    assert outcome(batch, name).status == "passed"
    assert "returned None, but the Builder says online=True" in outcome(replace(batch, online=True), name).found


def test_loops_and_unknown_landmarks_are_asked_of_those_that_promise_them() -> None:
    assert outcome(build(Sound, loops=True), "loop-closures-are-used").status == "failed"
    assert outcome(build(Sound, associates=True), "unknown-landmarks-are-told-apart").status == "failed"


def test_loops_that_are_used_wrongly_are_caught() -> None:
    class Jumps(Sound):
        """Moves by a centimetre at every loop closure."""

        def step(self, step: Step) -> Pose | None:
            pose = self.ekf.step(step)
            self.ekf.mean[0] += 0.01 * len(step.loops.to)
            return pose

    class Sure(Sound):
        """Is certain of a coordinate once a loop has been closed."""

        closed = False

        def step(self, step: Step) -> Pose | None:
            self.closed |= len(step.loops.to) > 0
            return self.ekf.step(step)

        def belief(self) -> Belief | None:
            found = super().belief()
            cov = np.diag([0.0, 1.0, 1.0]) if self.closed else found.cov
            return found._replace(cov=cov)

    together = "loop-closures-and-sightings-go-together"
    assert "m off at step" in outcome(build(Jumps, loops=True), together).found
    assert "eigenvalue" in outcome(build(Sure, loops=True), together).found
    assert outcome(build(Sound, loops=True), together).status == "passed"


def test_a_random_backend_may_sample() -> None:
    """Wandering as far as one particle would must pass; a tenfold of it must not."""

    class Particle(Sound):
        """One particle: every motion is drawn from its noise."""

        wild = 1.0

        def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
            super().__init__(prior, options, rng)
            self.pose = prior.pose + self.wild * rng.multivariate_normal(np.zeros(3), prior.cov)

        def step(self, step: Step) -> Pose | None:
            if step.odometry is not None:
                delta, cov = step.odometry
                self.pose = compose(self.pose, delta + self.wild * self.rng.multivariate_normal(np.zeros(3), cov))
            return self.pose.copy()

        def belief(self) -> Belief | None:
            return Belief(self.pose.copy())

        def map(self) -> Map:
            return Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    class Wild(Particle):
        """The same with ten times the noise."""

        wild = 10.0

    exact = {"it-starts-at-the-prior", "without-sightings-it-is-dead-reckoning", "an-exact-log-is-followed"}
    for name in exact:
        assert outcome(build(Particle, random=True), name).status == "passed"
    assert {name for name in exact if outcome(build(Wild, random=True), name).status == "failed"}
    assert outcome(build(Particle, random=True), "chance-comes-from-its-generator").status == "passed"
    assert outcome(build(Particle, random=True), "the-map-holds-what-was-seen").status == "not applicable"


def test_a_backend_that_ignores_sightings_is_said_to() -> None:
    found = outcome(registry.find("dead-reckoning"), "sightings-make-a-difference")
    assert (found.status, found.found) == ("not applicable", BLIND)
    assert "landmarks in its map" in outcome(build(Sound), "sightings-make-a-difference").found


def test_options_are_handed_on() -> None:
    @dataclass(frozen=True)
    class Options:
        off: float = option(0.0, "distance to be off by (m)")

    class Off(Sound):
        """Off by an option."""

        def step(self, step: Step) -> Pose | None:
            return self.ekf.step(step) + np.array([self.options.off, 0, 0])

    assert outcome(build(Off, options=Options), "it-starts-at-the-prior").status == "passed"
    outcomes = check(build(Off, options=Options), Options(0.1))
    failed = {found.name for found in outcomes if found.status == "failed"}
    assert {"an-exact-log-is-followed", "it-starts-at-the-prior"} <= failed


def test_the_logs_are_what_the_checks_take_them_for() -> None:
    exact = drive(np.random.default_rng(0), around(90), errors=0.0)
    np.testing.assert_allclose(dead_reckoned(exact.log)[0], exact.path, atol=1e-13)
    assert set(exact.log.ids.tolist()) == set(IDS.tolist())
    honest = drive(np.random.default_rng(1), around(400))
    errors = honest.log.delta[1:] - around(400)
    # the mean of n chi-square values with 3 degrees of freedom is 3, six of its standard errors 6 sqrt(6 / n)
    squares = np.einsum("ki,kij,kj->k", errors, np.linalg.inv(honest.log.delta_cov[1:]), errors)
    assert abs(squares.mean() - 3) < 6 * np.sqrt(6 / len(squares))
    fixed, drawn = (with_map(honest, cov, np.random.default_rng(2)).log.prior.map for cov in (None, 1e-2 * np.eye(24)))
    np.testing.assert_array_equal(fixed.xy, honest.map.xy)
    assert 0.05 < np.std(drawn.xy - fixed.xy) < 0.2
    log = behind(np.random.default_rng(3), 0.0, errors=0.0).log
    assert (log.z[log.ids == IDS[0], 1] == np.pi).all()
    log = behind(np.random.default_rng(3), np.pi).log
    assert set(np.sign(log.z[log.ids == IDS[0], 1])) == {-1, 1}
    assert np.abs(log.z[log.ids == IDS[0], 1]).min() > 3
    loop = with_loop(exact, 10).log
    np.testing.assert_allclose(compose(exact.path[10], loop.loop_delta[0]), exact.path[-1], atol=1e-12)
    assert len(loop.ids) == 0


@pytest.mark.parametrize("loss", ["huber", "cauchy", "geman-mcclure"])
def test_a_loop_that_corrects_a_drift_is_none_that_a_loss_rejects(loss: str) -> None:
    for builder in (registry.find("isam2"), registry.find("graph")):
        found = next(check for check in CHECKS if check.name == "loop-closures-are-used")
        assert examine(found, Candidate(builder, builder.options(loss=loss))).status == "passed"


def test_distances_are_told_with_their_step() -> None:
    path = np.zeros((4, 3))
    bounds = (np.full(4, 0.1), np.full(4, 0.1))
    assert stays_near(path, path + np.array([0.05, 0, 2 * np.pi]), bounds, "it") == pytest.approx(0.05)
    path[2, 0] = 0.2
    with pytest.raises(Failed, match=r"it is 0\.2 m off at step 2, expected at most 0\.1 m"):
        stays_near(path, np.zeros((4, 3)), bounds, "it")
    with pytest.raises(Failed, match=r"it is 0\.2 rad off at step 0"):
        stays_near(path, path + np.array([0, 0, 0.2]), bounds, "it")


def conforms(name: str, checks: Sequence[Check]) -> None:
    builder = registry.find(name)
    if lacking := builder.lacks():
        pytest.skip(f"{name}: {lacking}")
    outcomes = check(builder, checks=checks)
    assert [found for found in outcomes if found.status == "failed"] == []
    ends = {"passed", "gave up"} if name != "mcl" else {"not applicable"}  # these logs have no map for it
    adverse = {one.name for one in ADVERSARIAL} - {"stands-logs-without-ids"}  # by default none stands that
    adverse -= {"a-given-map-of-both"} if name == "g2o" else set()  # it has no edge for a joint covariance
    assert {found.status for found in outcomes if found.name in adverse} <= ends


@pytest.mark.parametrize("name", ["ekf", "smoother", "isam2", "graph", "fastslam"])
def test_what_comes_with_slamduel_conforms(name: str) -> None:
    """One of each kind; the EKF and the smoother on those adversarial logs, too, on which a broken backend fails."""
    more = chosen(sorted({adversary for _, adversary, _ in ADVERSE})) if name in ("ekf", "smoother") else ()
    conforms(name, (*QUICK, *more))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(registry.BUILTIN))
def test_what_comes_with_slamduel_conforms_on_every_adversarial_log(name: str) -> None:
    conforms(name, CHECKS)


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["ekf[association=jcbb]", "ekf[moved=out]"])
def test_what_decides_on_sightings_conforms_on_every_adversarial_log(variant: str) -> None:
    outcomes = check(variant, checks=CHECKS)
    assert [(found.name, found.found) for found in outcomes if found.status == "failed"] == []
