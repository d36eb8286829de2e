"""A map that the robot of a simulated world is given: the log is otherwise the same, and the map is as stated."""

import numpy as np
import pytest

import slamduel
from refusals import refused
from slamduel.backends.locating.locating import begin
from slamduel.backends.registry import find
from slamduel.bench.plan.given_map import localising
from slamduel.core.factors import Log, Map, Truth
from slamduel.core.factors.check import problems
from slamduel.datasets import registry
from slamduel.datasets.on_map import OnMap

WORLD = "city[landmarks=200,steps=60"


def made(options: str = "", seed: int = 1) -> tuple[Log, Truth]:
    log, truth = slamduel.load(f"{WORLD}{options}]", seed=seed)
    assert truth is not None
    return log, truth


def given(log: Log) -> Map:
    assert log.prior.map is not None
    return log.prior.map


def true(truth: Truth) -> Map:
    assert truth.map is not None
    return truth.map


def test_every_simulated_world_can_give_one() -> None:
    able = {name for name in registry.BUILTIN if issubclass(registry.find(name).options, OnMap)}
    assert able == {
        "aruco-robot",
        "aruco-room",
        "bailey",
        "circle",
        "city",
        "linear",
        "matlab-report",
        "patrol",
        "world",
    }


@pytest.mark.parametrize("kind", ["surveyed", "foreign"])
def test_the_log_is_the_one_without_a_map_in_everything_else(kind: str) -> None:
    (plain, truth), (log, again) = made(",clutter=0.5,ids=0.5"), made(f",clutter=0.5,ids=0.5,map={kind},start=unknown")
    for name in ("t", "delta", "delta_cov", "sighting_first", "ids", "z", "z_cov"):
        np.testing.assert_array_equal(getattr(log, name), getattr(plain, name))
    np.testing.assert_array_equal(truth.poses, again.poses)
    np.testing.assert_array_equal(true(truth).xy, true(again).xy)
    assert plain.prior.map is None
    assert log.prior.start == "unknown"
    assert log.notes["given map"] == kind
    assert log.digest != plain.digest
    assert not list(problems(log))


def test_a_surveyed_map_has_the_errors_that_it_states() -> None:
    log, truth = made(",map=surveyed,map_sd=0.3")
    known = given(log)
    assert known.cov is not None
    assert np.array_equal(known.ids, true(truth).ids)
    assert np.array_equal(known.cov, 0.09 * np.eye(400))
    # 400 errors: their standard deviation is known to 3.5 %.
    assert (known.xy - true(truth).xy).std() == pytest.approx(0.3, rel=0.15)
    assert log.prior.start == "known"


def test_the_errors_of_one_seed_are_multiples_of_one_draw() -> None:
    one, two = (given(made(f",map=surveyed,map_sd={sd}")[0]).xy - true(made()[1]).xy for sd in (0.1, 0.2))
    assert two == pytest.approx(2 * one, abs=1e-9)
    other = given(made(",map=surveyed,map_sd=0.1", seed=2)[0]).xy - true(made(seed=2)[1]).xy
    assert not np.allclose(one, other)


def test_on_another_worlds_map_nothing_is_where_it_is() -> None:
    log, truth = made(",map=foreign")
    known = given(log)
    mirrored = true(truth).xy * (-1, 1)
    spacing = np.sqrt(np.prod(np.ptp(true(truth).xy, axis=0)) / 200)
    assert np.hypot(*(known.xy - mirrored).T).mean() > 0.5 * spacing
    assert np.ptp(known.xy, axis=0) == pytest.approx(np.ptp(mirrored, axis=0), rel=0.5)


def test_a_robot_is_found_on_its_map_and_not_on_anothers() -> None:
    builder = find("ekf")
    for kind, wanted in (("surveyed", True), ("foreign", False)):
        log, truth = made(f",ids=hidden,map={kind},start=unknown")
        backend = begin(builder, log.prior, builder.options(association="jcbb"), np.random.default_rng(0))
        for step in log:
            backend.step(step)
        belief = backend.belief()
        assert belief.located == wanted
        if wanted:
            assert np.hypot(*(belief.pose - truth.poses[-1])[:2]) < 0.5


def test_an_unknown_start_without_a_map_and_a_second_map_are_refused() -> None:
    refused(r"dataset city: option start=unknown: there is no map to start on, expected", made, ",start=unknown")
    log, truth = made(",map=surveyed")
    refused("has a map of its own", localising, log, true(truth), "dataset city")
