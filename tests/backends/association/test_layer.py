"""Data association in front of a backend, on logs whose ids are known to the test alone."""

import pickle
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest

from driven import make, run
from lost_logs import ring, unnamed
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Builder, Expected, Unsuited
from slamduel.backends.association.builders import associating
from slamduel.backends.association.layer import Associating
from slamduel.backends.association.names import FIRST
from slamduel.backends.association.options import Association, Moved, check
from slamduel.backends.gaussian import ekf
from slamduel.bench.measure.association import association_columns
from slamduel.core.errors import InputError
from slamduel.core.factors import UNKNOWN, Log, Map, RangeBearing
from slamduel.core.options import option

BACKENDS = ("ekf", "fastslam", "fixed-lag", "invariant-ekf", "isam2", "kf", "smoother", "ukf")


def driven(name: str, log: Log, **options: Any) -> Any:
    return run(name, log, **options)[0]


def row_of(backend: Any, log: Log) -> dict[str, Any]:
    return association_columns(backend.assigned(), log.ids)


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("rule", ["nn", "ml", "jcbb"])
def test_on_a_ring_of_well_separated_landmarks_every_rule_is_right(name: str, rule: str) -> None:
    log = ring().log
    backend = driven(name, unnamed(log), association=rule, **({"lag": 1e6} if name == "fixed-lag" else {}))
    row = row_of(backend, log)
    assert row["wrong_share"] == 0
    assert row["landmarks_merged"] == row["landmarks_clutter"] == 0
    if name != "kf":  # which is lost in the end: its heading is that of dead reckoning
        assert row["landmarks_double"] <= 1
        assert row["dropped_share"] < 0.01
    ids = backend.map().ids
    assert len(np.unique(ids)) == len(ids)
    assert set(ids.tolist()) == set(backend.assigned().tolist()) - {UNKNOWN}
    assert ids.max() <= FIRST


@pytest.mark.parametrize("name", BACKENDS)
def test_known_ids_go_through_untouched(name: str) -> None:
    log = random_log(np.random.default_rng(3), 40, 8).log
    plain = make(name, log.prior)
    behind = make(name, log.prior, association="jcbb")
    for step in log:
        assert plain.step(step).tobytes() == behind.step(step).tobytes()
    assert behind.assigned().tolist() == log.ids.tolist()
    assert behind.map().ids.tolist() == plain.map().ids.tolist()


def test_a_landmark_is_taken_once_a_step() -> None:
    log = ring().log
    backend = driven("ekf", unnamed(log), association="jcbb")
    for ids in np.split(backend.assigned(), log.sighting_first[1:-1]):
        taken = ids[ids != UNKNOWN]
        assert len(np.unique(taken)) == len(taken)


def test_some_ids_known_others_join_the_same_landmarks() -> None:
    log = ring().log
    some = np.where(np.random.default_rng(5).random(len(log.ids)) < 0.5, UNKNOWN, log.ids)
    backend = driven("ekf", replace(log, ids=some), association="jcbb")
    found = backend.assigned()
    assert (found[some != UNKNOWN] == some[some != UNKNOWN]).all()
    assert (found == log.ids).mean() > 0.9
    assert row_of(backend, log)["wrong_share"] < 0.02


def test_a_landmark_that_got_its_known_id_late_is_in_the_map_once() -> None:
    """Where a step has known ids alone nothing is decided, but the landmark was mapped under a made-up id."""
    log = ring().log
    late = np.where(np.arange(len(log.ids)) < len(log.ids) // 2, UNKNOWN, log.ids)
    backend = driven("ekf", replace(log, ids=late), association="jcbb")
    assert len(backend.inner.map().ids) == len(np.unique(log.ids))
    ids = backend.map().ids.tolist()
    assert sorted(ids) == sorted(set(ids))
    assert set(log.ids[late != UNKNOWN].tolist()) <= set(ids)
    assert (backend.assigned()[late != UNKNOWN] == log.ids[late != UNKNOWN]).all()


def test_on_a_given_map_its_ids_are_found() -> None:
    log = ring().log
    known = driven("ekf", log).map()
    given = replace(unnamed(log), prior=log.prior._replace(map=known))
    for name in BACKENDS:
        found = driven(name, given, association="jcbb", **({"lag": 1e6} if name == "fixed-lag" else {})).assigned()
        assert (found[found > UNKNOWN] == log.ids[found > UNKNOWN]).mean() > 0.99
        if name != "kf":
            assert (found == log.ids).mean() > 0.95


def test_made_up_ids_are_none_of_a_given_map_that_was_made_unnamed() -> None:
    log, truth = ring()
    kept = np.arange(0, len(truth.map.ids), 2)  # the others are new
    given = Map(FIRST - kept, truth.map.xy[kept], 1e-4 * np.eye(2 * len(kept)))
    lost = replace(unnamed(log), prior=log.prior._replace(map=given))
    backend = driven("ekf", lost, association="jcbb")
    named = np.where(np.isin(log.ids, kept), FIRST - log.ids, UNKNOWN)
    assigned = backend.assigned()
    assert np.array_equal(assigned[named != UNKNOWN], named[named != UNKNOWN])
    assert not np.isin(assigned[named == UNKNOWN], given.ids).any()
    assert len(backend.map().ids) == len(np.union1d(kept, log.ids))


def test_clutter_is_not_born_where_it_has_to_be_confirmed() -> None:
    made = ring(clutter=0.5)
    assert made.truth is not None
    assert made.truth.assigned is not None
    log, true = unnamed(made.log), made.truth.assigned
    rows = [
        association_columns(driven_to_the_end("ekf", log, association="jcbb", **more).assigned(), true)
        for more in ({}, {"confirm": 2, "within": 4}, {"retire": 8})
    ]
    assert rows[0]["landmarks_clutter"] > 20
    assert rows[1]["landmarks_clutter"] <= 2
    assert rows[1]["landmarks_double"] <= 1
    taken_out = driven_to_the_end("ekf", log, association="jcbb", retire=8)
    assert len(taken_out.map().ids) < rows[0]["landmarks_clutter"]


def driven_to_the_end(name: str, log: Log, **options: Any) -> Any:
    backend = driven(name, log, **options)
    backend.finish()
    return backend


@pytest.mark.parametrize("more", [{"lookahead": 12}, {"confirm": 1, "within": 3}])
def test_steps_that_wait_are_all_handed_on_and_the_pose_until_then_is_odometrys(more: dict[str, Any]) -> None:
    made = ring()
    log, truth = made
    backend = make("smoother", log.prior, association="jcbb", **more)
    path = []
    for step in unnamed(log):
        path.append(backend.step(step))
        believed = backend.belief()
        assert believed.pose.tobytes() == path[-1].tobytes()
        assert np.linalg.eigvalsh(believed.cov).min() > 0
        assert len(believed.assigned) == len(step.sightings.ids)
    assert (backend.assigned()[-3:] == UNKNOWN).all()
    solution = backend.finish()
    assert len(solution.path) == len(log)
    assert row_of(backend, log)["wrong_share"] == 0
    assert np.hypot(*(np.array(path) - truth.poses)[:, :2].T).max() < 0.6


def test_a_frame_that_would_be_mostly_new_is_looked_for_on_the_map() -> None:
    """One motion, in the middle of the second round, is off by ten of its standard deviations."""
    log = ring(landmarks=40).log
    delta = log.delta.copy()
    delta[90] += [0.0, 0.0, 0.6]
    off = Log.from_arrays("off", log.prior, log.t, delta, log.delta_cov, log.sighting_step, log.ids, log.z, log.z_cov)
    double = {
        rescue: row_of(driven("smoother", unnamed(off), association="jcbb", rescue=rescue), off)["landmarks_double"]
        for rescue in (False, True)
    }
    assert double[False] >= 5
    assert double[True] <= 2


def test_it_gives_the_same_bits_again_and_shares_nothing() -> None:
    log = unnamed(random_log(np.random.default_rng(9), 60, 12).log)
    first, second = (make("ekf", log.prior, association="jcbb", lookahead=4) for _ in range(2))
    paths = [(first.step(step), second.step(step)) for step in log]
    assert all(a.tobytes() == b.tobytes() for a, b in paths)


def test_options_are_those_of_the_backend_and_of_the_layer_and_travel_to_workers() -> None:
    builder = registry.find("ekf")
    names = [field.name for field in fields(builder.options)]
    assert names == [f.name for kind in (ekf.Options, Moved, Association) for f in fields(kind)]
    chosen = builder.options(gate=0.9, association="ml", match=0.95)
    again = pickle.loads(pickle.dumps(chosen))
    assert again == chosen
    assert type(again) is type(chosen)
    assert builder.associating(chosen)
    assert not builder.associating(builder.options())


def test_options_without_effect_are_refused() -> None:
    builder = registry.find("ekf")
    check(builder.options(association="nn", confirm=3), "backend ekf")
    with pytest.raises(
        InputError, match=r"backend ekf: option confirm is for data association; expected association=nn"
    ):
        check(builder.options(confirm=3), "backend ekf")
    for name in ("isam2", "ekf"):
        with pytest.raises(InputError, match=r"option merge is for .* expected association=.* of ekf, kf or smoother"):
            check(registry.find(name).options(merge=True), f"backend {name}")
    with pytest.raises(InputError, match="option confirm=9: expected at most within=3, the steps"):
        check(builder.options(association="nn", confirm=9, within=3), "backend ekf")
    with pytest.raises(InputError, match=r"option match=0\.9999: expected at most new=0\.9, beyond which"):
        check(builder.options(association="nn", match=0.9999, new=0.9), "backend ekf")


def test_a_map_without_covariance_and_a_solver_that_cannot_tell_are_unsuited() -> None:
    log = ring().log
    fixed = log.prior._replace(map=Map(np.array([1]), np.zeros((1, 2)), None))
    with pytest.raises(Unsuited, match="data association needs the covariance of the given map"):
        make("ekf", fixed, association="nn")
    with pytest.raises(Unsuited, match="cannot state what it expects to see"):
        make("fixed-lag by gtsam", log.prior, association="nn")


@dataclass(frozen=True)
class Own:
    """Options of a plug-in."""

    speed: float = option(1.0, "anything")


class Plugin(ekf.Ekf):
    """A plug-in with the one method."""

    def __init__(self, prior: Any, options: Own, rng: Any) -> None:
        super().__init__(prior, ekf.Options(), rng)


class Blind:
    """A plug-in without it."""


@dataclass(frozen=True)
class Clashing:
    """Options of a plug-in, one of which the layer has, too."""

    match: int = option(1, "anything")


def test_a_plug_in_gets_it_by_one_method() -> None:
    log = ring().log
    builder = associating(Builder(Plugin, options=Own))
    backend = builder.make(log.prior, builder.options(association="jcbb"), np.random.default_rng(0))
    assert isinstance(backend, Associating)
    for step in unnamed(log):
        backend.step(step)
    assert row_of(backend, log)["wrong_share"] == 0
    blind: Any = Builder(Blind, options=Own)  # pyright: ignore[reportArgumentType]
    assert associating(blind) is blind
    with pytest.raises(TypeError, match="options match of Clashing are those of data association, too"):
        associating(Builder(Plugin, options=Clashing))


class Silent(Plugin):
    """It expects nothing, ever."""

    def expected(self, odometry: Any, seen: RangeBearing, gate: float) -> Expected:
        return Expected(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 0)))


def test_where_nothing_is_expected_all_is_new() -> None:
    log = ring().log.head(5)
    builder = associating(Builder(Silent, options=Own))
    backend: Any = builder.make(log.prior, builder.options(association="nn", rescue=False), np.random.default_rng(0))
    for step in unnamed(log):
        backend.step(step)
    assert backend.assigned().tolist() == list(range(FIRST, FIRST - len(log.ids), -1))
