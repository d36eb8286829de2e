"""The reason of a cell says why a backend and a log do not go together, and what a backend was not given."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slamduel.backends import registry as backends
from slamduel.bench.measure.cell import Job, Result, run_on
from slamduel.bench.plan.load import load
from slamduel.core.factors import UNKNOWN, Log, Systematic
from slamduel.core.partial import NO_IDS
from slamduel.datasets.remarks import remarks

WORLD = "circle[steps=60]"
NOTHING = "no sighting of the log has an id"


def cell(log: Log, name: str, **options: Any) -> Result:
    found = backends.find(name).options(**options)
    given = f"[{','.join(f'{key}={value}' for key, value in options.items())}]" if options else ""
    return run_on(Job(f"{name}{given}", name, found, 0, 4000), lambda: log, lambda: None)


def test_a_backend_that_could_associate_is_named_with_the_option() -> None:
    hidden = load("circle[steps=60,ids=hidden]").log
    found = cell(hidden, "ekf")
    assert found.status == "skipped"
    assert found.reason == f"{NOTHING}, and ekf does no data association; ekf[association=jcbb] does"
    assert cell(hidden, "ekf", association="jcbb").status == "done"  # as it advises
    found = cell(hidden, "smoother", loss="cauchy")
    assert found.reason == (
        f"{NOTHING}, and smoother[loss=cauchy] does no data association; smoother[association=jcbb] does"
    )


def test_of_a_backend_that_cannot_associate_another_is_named() -> None:
    hidden = load("circle[steps=60,ids=hidden]").log
    found = cell(hidden, "textbook-ekf")
    assert found.status == "skipped"
    assert found.reason == f"{NOTHING}: textbook-ekf takes no hidden ids; ekf[association=jcbb] does"
    assert cell(hidden, "dead-reckoning").status == "done"  # uses none


def test_a_log_with_ids_and_association_do_not_go_together() -> None:
    found = cell(load(WORLD).log, "ekf", association="nn")
    assert found.status == "skipped"
    assert found.reason == (
        "every sighting of the log has an id; DATASET[ids=hidden] hides those of a simulated or published log"
    )
    log = load(WORLD).log
    one = log.ids.copy()
    one[3] = UNKNOWN
    assert cell(replace(log, ids=one), "ekf", association="nn").status == "done"


@pytest.mark.parametrize(
    ("world", "backend", "said"),
    [
        ("circle[steps=60,ranges_only=0.5]", "dead-reckoning", "{partial} partial sightings are left out"),
        ("circle[steps=60,gps=20]", "dead-reckoning", "{fixes} fixes are left out"),
    ],
)
def test_what_a_backend_was_not_given_is_said(world: str, backend: str, said: str) -> None:
    log = load(world).log
    found = cell(log, backend)
    partial, fixes = (0 if table is None else len(table) for table in (log.partial, log.fixes))
    assert found.status == "done"
    assert said.format(partial=partial, fixes=fixes) in found.reason.split("; ")


def test_one_measurement_that_is_left_out_is_one() -> None:
    log = load("circle[steps=60,gps=20]").log
    assert log.fixes is not None
    one = replace(log, fixes=log.fixes.rows(np.array([0])))
    assert "1 fix is left out" in cell(one, "dead-reckoning").reason.split("; ")


def test_a_scale_of_the_wheels_that_is_not_estimated_is_said() -> None:
    log = load(WORLD).log
    unknown = replace(log, prior=log.prior._replace(systematic=Systematic(wheel_scale=0.05)))
    said = "the wheels' scale, which is not known, is not estimated"
    assert not backends.find("fastslam").wheel_scale
    assert said in cell(unknown, "fastslam").reason.split("; ")
    assert backends.find("ekf").wheel_scale
    assert said not in cell(unknown, "ekf").reason
    assert said not in cell(log, "fastslam").reason


@pytest.mark.parametrize("backend", ["ekf", "smoother", "graph", "fastslam"])
def test_ranges_alone_without_any_id_are_skipped(backend: str) -> None:
    log = load("circle[steps=60,ranges_only=1,ids=hidden]").log
    assert log.partial is not None
    assert not len(log.ids)
    assert log.unknown == log.sighted > 0
    found = cell(log, backend)
    assert (found.status, found.reason) == ("skipped", NO_IDS)
    assert cell(log, "dead-reckoning").status == "done"
    if backend == "ekf":
        assert cell(log, backend, association="jcbb").reason == NO_IDS


@pytest.mark.parametrize("part", ["ranges_only", "bearings_only"])
def test_such_a_log_has_that_reason_as_a_remark_and_no_other_log_has_it(part: str) -> None:
    hidden, named = (load(f"circle[steps=60,{part}=1{more}]") for more in (",ids=hidden", ""))
    assert NO_IDS in remarks(hidden)
    assert NO_IDS not in remarks(named)
    assert NO_IDS not in remarks(load(f"circle[steps=60,{part}=0.5,ids=hidden]"))  # whole ones may be told by place
    fixed = load(f"circle[steps=60,{part}=1,ids=hidden,gps=10]")
    assert NO_IDS not in remarks(fixed)
    one = named.log.partial
    assert one is not None
    single = np.where(np.arange(len(one)) == 0, one.ids, UNKNOWN)
    assert NO_IDS not in remarks(named._replace(log=replace(named.log, partial=replace(one, ids=single))))


def test_parts_without_ids_beside_what_else_is_used_are_left_out_and_counted() -> None:
    log = load("circle[steps=60,ranges_only=1,ids=hidden,gps=10]").log
    assert log.partial is not None
    found = cell(log, "ekf")
    assert found.status == "done"
    assert f"{len(log.partial)} partial sightings are left out" in found.reason.split("; ")
    mixed = load("circle[steps=60,ranges_only=0.5]").log
    assert mixed.partial is not None
    blind = replace(mixed, ids=np.full_like(mixed.ids, UNKNOWN))
    assert cell(blind, "ekf").status == "done"  # its ranges have ids
    known = load("circle[steps=60,ranges_only=1,ids=hidden]")
    assert known.truth is not None
    assert known.truth.map is not None
    n = 2 * len(known.truth.map.ids)
    surveyed = known.truth.map._replace(cov=1e-4 * np.eye(n))
    given = replace(known.log, prior=known.log.prior._replace(map=surveyed))
    assert cell(given, "ekf").reason == f"{NOTHING}, and ekf does no data association; ekf[association=jcbb] does"
    assert cell(given, "ekf", association="jcbb").status == "done"
