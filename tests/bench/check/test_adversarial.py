"""The adversarial logs: what they claim to be, the bound they are judged by, and that each fault is found."""

import numpy as np
import pytest

from broken_backends import ADVERSE, GivesUp, Sound
from slamduel.backends.api import Builder, Map
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.bench.check import adversarial
from slamduel.bench.check.adversarial import BatchAnswer, batch_answer, bound, filtered, ordinary, uses_sightings
from slamduel.bench.check.adversarial_logs import ADVERSARIES, Adversary
from slamduel.bench.check.candidate import Candidate, spread
from slamduel.bench.check.isolated import examined
from slamduel.bench.check.log_recipe import made_log
from slamduel.bench.check.small_logs import dead_reckoned
from slamduel.bench.check.suite import ADVERSARIAL, CHECKS, Outcome, check, chosen, examine
from slamduel.bench.cli import main
from slamduel.core.errors import InputError
from slamduel.core.factors import Log, Truth
from slamduel.core.factors.check import problems
from slamduel.core.se2 import wrap

BY_NAME = {adversary.name: adversary for adversary in ADVERSARIES}


def log(name: str) -> Log:
    return BY_NAME[name].made.log


def outcome(builder: Builder, name: str) -> Outcome:
    (check,) = chosen([name])
    return examine(check, Candidate(builder, builder.options()))


def test_there_are_fifty_and_all_are_valid_and_always_the_same() -> None:
    assert len(BY_NAME) == len(ADVERSARIAL) - 1 == 50  # and all of them without ids
    assert len({check.name for check in CHECKS}) == len(CHECKS)
    for adversary in ADVERSARIES:
        made = adversary.made
        assert list(problems(made.log)) == [], adversary.name
        again = Adversary(adversary.name, adversary.title, adversary.make).made
        assert again.log.digest == made.log.digest, adversary.name
        assert adversary.title.endswith("."), adversary.name
        assert len(made.path) == len(made.log)
    assert sum(bool(adversary.may_end) for adversary in ADVERSARIES) <= 12


def test_they_are_as_hard_as_their_names() -> None:
    variances = {name: log(name).z_cov[:, [0, 1], [0, 1]] for name in ("sure-sightings", "unsure-sightings")}
    np.testing.assert_allclose(variances["sure-sightings"], 1e-12)
    np.testing.assert_allclose(variances["unsure-sightings"], 1e6)
    np.testing.assert_allclose(log("sure-odometry").delta_cov[1:, [0, 1, 2], [0, 1, 2]], 1e-12)
    np.testing.assert_allclose(log("unsure-odometry").delta_cov[1:, [0, 1, 2], [0, 1, 2]], 1e6)
    np.testing.assert_allclose(np.diag(log("sure-start").prior.cov), 1e-12)
    assert log("zero-range").z[0, 0] < 1e-8
    assert log("a-millimetre-away").z[0, 0] < 2e-3
    assert log("beyond-a-kilometre").z[:, 0].max() > 1000
    assert (log("bearing-exactly-pi").z[::2, 1] == np.pi).all()
    assert (log("bearing-next-to-minus-pi").z[::2, 1] == np.nextafter(-np.pi, 0)).all()
    assert set(np.sign(log("across-the-cut").z[:, 1])) == {-1, 1}
    assert np.ptp(log("an-hour-standing").t) >= 3599
    assert np.bincount(log("an-id-seen-once").ids).max() == 1
    assert log("huge-ids").ids.max() == 2**53
    for name in ("500-new-in-a-frame", "500-known-in-a-frame"):
        assert np.diff(log(name).sighting_first).max() == 500
    loop = BY_NAME["a-huge-loop"].made
    assert np.hypot(*np.diff(loop.path[:, :2], axis=0).T).sum() > 9_999
    assert np.isin(loop.log.ids[loop.log.sighting_step < 5], loop.log.ids[loop.log.sighting_step > 980]).all()
    assert len(log("no-sightings").ids) == 0
    assert len(log("one-step")) == 1


def test_errors_are_drawn_from_what_is_claimed() -> None:
    """The mean of n chi-square values of k degrees of freedom is k, six of its standard errors 6 sqrt(2 k / n)."""
    made = made_log(np.random.default_rng(1), np.tile([0.3, 0.0, 0.075], (600, 1)), correlation=0.9)
    error = made.log.delta[1:] - [0.3, 0.0, 0.075]
    squares = np.einsum("ki,kij,kj->k", error, np.linalg.inv(made.log.delta_cov[1:]), error)
    assert abs(squares.mean() - 3) < 6 * np.sqrt(6 / len(squares))
    place = dict(zip(made.map.ids.tolist(), made.map.xy, strict=True))
    d = np.array([place[i] for i in made.log.ids.tolist()]) - made.path[made.log.sighting_step, :2]
    exact = np.stack((np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0]) - made.path[made.log.sighting_step, 2]), axis=1)
    error = made.log.z - exact
    error[:, 1] = wrap(error[:, 1])
    squares = np.einsum("ki,kij,kj->k", error, np.linalg.inv(made.log.z_cov), error)
    assert abs(squares.mean() - 2) < 6 * np.sqrt(4 / len(squares))


@pytest.mark.parametrize("blind", [False, True])
def test_the_bound_is_that_of_the_textbook_filter_where_all_is_linear(blind: bool) -> None:
    """On an exact log with a ten thousandth of the usual noise the second order is in the eighth digit."""
    tiny = {"prior_sd": (5e-6, 5e-6, 2e-6), "motion_sd": (2e-6, 1e-6, 1e-6), "sighting_sd": (5e-6, 2e-6)}
    made = made_log(np.random.default_rng(2), errors=0.0, reach=0.0 if blind else 5.0, **tiny)  # pyright: ignore
    ekf = TextbookEkf(made.log.prior, together=True)
    expected = []
    for step in made.log:
        ekf.step(step)
        expected.append(ekf.cov[:3, :3])
    sd = np.sqrt(np.einsum("kii->ki", np.array(expected)))
    off = (filtered(made, blind=blind) - expected) / (sd[:, :, None] * sd[:, None, :])
    assert np.abs(off).max() < 1e-3
    seen = made_log(np.random.default_rng(2), errors=0.0, **tiny)  # pyright: ignore
    np.testing.assert_array_equal(filtered(seen, blind=True), filtered(seen._replace(map=made.map), blind=True))


def test_what_is_of_second_order_widens_the_bound() -> None:
    plain = made_log(np.random.default_rng(3))
    first_order = dead_reckoned(plain.log)[1]
    grown = filtered(plain, blind=True)
    assert np.linalg.eigvalsh(grown[-1] - first_order[-1])[-1] > 0
    np.testing.assert_allclose(grown, first_order, atol=0.1 * np.abs(first_order).max())


@pytest.mark.slow
def test_the_batch_answers_are_near_the_truth() -> None:
    """They are what the others are measured by: six standard deviations of the same covariance, and the planted."""
    batches = 0
    for adversary in ADVERSARIES:
        answer = batch_answer(adversary)
        if answer.batch:
            batches += 1
            off = np.hypot(*(answer.path - adversary.made.path)[:, :2].T)
            allowed = (1 + adversary.planted / 6) * spread(answer.cov)[0] + 1e-6 + 1e-9 * np.abs(answer.path).max()
            assert (off <= allowed).all(), adversary.name
    assert batches >= 40


def test_an_optimum_that_is_none_is_not_taken_for_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def elsewhere(log: Log) -> Truth:
        found = BY_NAME["one-landmark"].made
        return Truth(
            log.t, found.path + np.array([1.0, 0, 0]), Map(found.map.ids, found.map.xy, None), None, "reference"
        )

    monkeypatch.setattr(adversarial, "reference", elsewhere)
    own = Adversary("one-landmark", "The same, and not in the cache.", BY_NAME["one-landmark"].make)
    answer = batch_answer(own)
    assert not answer.batch
    np.testing.assert_array_equal(answer.path, own.made.path)


def test_a_backend_has_the_bound_of_its_kind() -> None:
    adversary = BY_NAME["huge-ids"]
    answer = batch_answer(adversary)
    filtering = Candidate(Builder(Sound), None)
    drawing = Candidate(Builder(Sound, random=True), None)
    assert uses_sightings(ordinary(filtering))
    narrow, wide = bound(filtering, adversary, answer), bound(drawing, adversary, answer)
    assert narrow[0][-1] < 0.5 * wide[0][-1]
    planted = bound(filtering, BY_NAME["one-slip"], BatchAnswer(*answer))[0]
    assert planted[-1] == pytest.approx(56 / 6 * narrow[0][-1], rel=1e-3)


@pytest.mark.parametrize(("broken", "name", "found"), ADVERSE, ids=lambda value: getattr(value, "__name__", None))
def test_each_fault_is_caught(broken: type[Sound], name: str, found: str) -> None:
    result = outcome(Builder(broken), name)
    assert (result.status, found in result.found) == ("failed", True), result


@pytest.mark.parametrize("name", sorted({name for _, name, _ in ADVERSE}))
def test_a_sound_backend_passes_where_the_broken_ones_do_not(name: str) -> None:
    assert outcome(Builder(Sound), name).status == "passed"


def test_giving_up_is_for_the_logs_that_allow_for_it() -> None:
    outcomes = [found for found in check(Builder(GivesUp), checks=ADVERSARIAL) if found.status != "not applicable"]
    allowed = {adversary.name for adversary in ADVERSARIES if adversary.may_end}
    assert {found.name for found in outcomes if found.status == "gave up"} == allowed
    assert sum(found.status == "failed" for found in outcomes) == 50 - len(allowed)
    assert all("the numbers looked odd" in found.found for found in outcomes)


def test_checks_are_chosen_by_family_and_name() -> None:
    assert chosen([]) == CHECKS
    assert chosen(["adversarial"]) == ADVERSARIAL
    assert [check.name for check in chosen(["huge-ids", "asking-changes-nothing"])] == [
        "asking-changes-nothing",
        "huge-ids",
    ]
    with pytest.raises(InputError, match="no check 'huge-id'; expected contract, estimates, adversarial, or names"):
        chosen(["huge-id"])


@pytest.mark.slow
def test_a_backend_that_hangs_fails_what_it_hangs_in_and_no_more() -> None:
    checks = chosen(["options-are-described", "it-starts-at-the-prior", "half-turns"])
    for name in ("misbehaving:loops_for_ever", "misbehaving:sleeps_for_ever"):
        outcomes = list(examined(name, None, checks, limit_s=2.0))
        assert [outcome.name for outcome in outcomes] == [check.name for check in checks]
        assert [outcome.found for outcome in outcomes[1:]] == 2 * ["it did not come back within 2 s"]
        assert "has no docstring" in outcomes[0].found


def test_a_backend_that_dies_fails_what_it_dies_in_and_no_more() -> None:
    checks = chosen(["options-are-described", "it-starts-at-the-prior", "half-turns"])
    described, *crashed = examined("misbehaving:crashes", None, checks, limit_s=60.0)
    assert "has no docstring" in described.found
    assert len(crashed) == 2
    assert all("was killed by SIGSEGV" in outcome.found for outcome in crashed)
    _, *left = examined("misbehaving:exits", None, checks, limit_s=60.0)
    assert all("it raised SystemExit: had enough" in outcome.found for outcome in left)


def test_each_outcome_comes_as_soon_as_it_is_known() -> None:
    checks = chosen(["options-are-described", "half-turns"])
    outcomes = examined("misbehaving:sleeps_for_ever", None, checks, limit_s=60.0)
    assert next(outcomes).name == "options-are-described"
    outcomes.close()  # type: ignore[attr-defined]  # the rest, which would take a minute, is not waited for


def test_the_command_says_how_many_are_done(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "dead-reckoning", "--only", "one-step,half-turns,headings-are-wrapped"]) == 0
    said = capsys.readouterr().out
    assert "dead-reckoning: adversarial logs: 2 done, 0 with a named reason, 0 failed" in said
    assert "passed         half-turns: at most" in said
    assert main(["check", "misbehaving:gives_up", "--only", "sure-start,sure-sightings", "--quiet"]) == 1
    said = capsys.readouterr().out
    assert "failed         sure-start: it gave up: the covariance is no longer positive definite; expected" in said
    assert "sure-sightings:" not in said
    assert "adversarial logs:" not in said
    assert main(["check", "ekf", "--only", "one-step", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
