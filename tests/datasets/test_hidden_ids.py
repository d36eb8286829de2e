"""Hidden ids: the log without them is the log with them in everything else, and the truth says what they were."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import slamduel
from refusals import refused
from slamduel.backends import registry as backends
from slamduel.bench.measure.drive import drive
from slamduel.bench.plan.spec import read_options
from slamduel.core.factors import UNKNOWN, Dataset, Log
from slamduel.core.factors.check import problems
from slamduel.core.files import cache_folder
from slamduel.core.se2 import Ints
from slamduel.datasets import registry
from slamduel.datasets.formats import log_folder
from slamduel.datasets.hidden_ids import HiddenIds, hidden
from slamduel.datasets.remarks import remarks

DATA = os.environ.get("SLAMDUEL_DATA")

QUICK = {
    "aruco-robot": "aruco-robot[seconds=10]",
    "aruco-room": "aruco-room[seconds=1]",
    "bailey": "bailey[loops=1]",
    "circle": "circle[steps=100]",
    "city": "city[landmarks=60,steps=60]",
    "linear": "linear[steps=100]",
    "matlab-report": "matlab-report",
    "patrol": "patrol[steps=60]",
    "victoria-park": "victoria-park",
}
PUBLISHED = {"dlr": "dlr[path={}/dlr]", "freiburg": "freiburg[path={}/freiburg]", "mrclam": "mrclam[path={}/mrclam]"}


def logs() -> list[Any]:
    missing = pytest.mark.skipif(DATA is None, reason="SLAMDUEL_DATA names no folder of published logs")
    there = [pytest.param(text.format(DATA), id=name, marks=missing) for name, text in PUBLISHED.items()]
    return [*(pytest.param(text, id=name) for name, text in QUICK.items()), *there]


def with_ids(text: str, ids: str) -> str:
    return f"{text[:-1]},ids={ids}]" if text.endswith("]") else f"{text}[ids={ids}]"


def assigned(dataset: Dataset) -> Ints:
    assert dataset.truth.assigned is not None
    return dataset.truth.assigned


def assert_same_but_ids(one: Log, other: Log) -> None:
    for name in ("t", "delta", "delta_cov", "sighting_first", "z", "z_cov", "loop_first", "loop_to"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.prior.pose, other.prior.pose)


def test_every_simulated_rendered_and_published_log_can_be_without() -> None:
    able = {name for name in registry.BUILTIN if issubclass(registry.find(name).options, HiddenIds)}
    assert able >= QUICK.keys() | PUBLISHED.keys()


@pytest.mark.parametrize("text", logs())
def test_a_log_without_ids_is_the_one_with_them_in_everything_else(text: str) -> None:
    plain, without, some = (slamduel.load(one, 1) for one in (text, with_ids(text, "hidden"), with_ids(text, "0.4")))
    assert set(without.log.ids.tolist()) == {UNKNOWN}
    share = float(((some.log.ids == UNKNOWN) & (plain.log.ids != UNKNOWN)).sum() / (plain.log.ids != UNKNOWN).sum())
    assert share == pytest.approx(0.4, abs=0.15)
    for made in (without, some):
        assert not list(problems(made.log))
        assert_same_but_ids(made.log, plain.log)
        true = plain.log.ids if plain.truth is None or plain.truth.assigned is None else plain.truth.assigned
        np.testing.assert_array_equal(assigned(made), true)
        assert made.log.digest != plain.log.digest
        if plain.truth is not None and made.truth is not None:
            np.testing.assert_array_equal(made.truth.poses, plain.truth.poses)
    left = some.log.ids != UNKNOWN
    np.testing.assert_array_equal(some.log.ids[left], plain.log.ids[left])


def test_a_larger_share_hides_what_a_smaller_one_hides_and_a_seed_is_one_log() -> None:
    few, again, many = (slamduel.load(f"circle[ids={share}]", seed=3).log for share in (0.2, 0.2, 0.6))
    assert few.digest == again.digest
    assert (many.ids[few.ids == UNKNOWN] == UNKNOWN).all()
    other = slamduel.load("circle[ids=0.2]", seed=4).log
    assert list(np.flatnonzero(other.ids == UNKNOWN)[:20]) != list(np.flatnonzero(few.ids == UNKNOWN)[:20])


def test_ids_that_are_known_are_the_log_itself() -> None:
    plain = slamduel.load("circle[steps=50]")
    for known in ("known", "0", "0.0"):
        made = slamduel.load(f"circle[steps=50,ids={known}]")
        assert made.log.digest == plain.log.digest
        assert made.log.notes == plain.log.notes


def test_wrong_and_false_ids_are_hidden_too_and_the_truth_knows_better() -> None:
    options = "steps=300,wrong_ids=0.2,clutter=0.5"
    plain, without = slamduel.load(f"circle[{options}]"), slamduel.load(f"circle[{options},ids=hidden]")
    np.testing.assert_array_equal(assigned(without), assigned(plain))
    assert (assigned(without) == UNKNOWN).any()
    assert (assigned(plain) != plain.log.ids).any()


@pytest.mark.skipif(DATA is None, reason="SLAMDUEL_DATA names no folder of published logs")
def test_the_circles_that_dlr_does_not_name_stay_in_the_log_with_no_true_id() -> None:
    plain, without = slamduel.load(f"dlr[path={DATA}/dlr]"), slamduel.load(f"dlr[path={DATA}/dlr,ids=hidden]")
    assert len(without.log.ids) == 14745
    assert (plain.log.ids == UNKNOWN).sum() == (assigned(without) == UNKNOWN).sum() == 436


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("secret", "found 'secret', expected one of known, hidden, or a number from 0 to 1"),
        ("1.5", "is out of range; expected one of known, hidden, or a number from 0 to 1"),
        ("-0.1", "is out of range"),
        ("nan", "is out of range"),
    ],
)
def test_what_is_neither_a_word_nor_a_share_is_refused(given: str, said: str) -> None:
    circle = registry.find("circle").options
    refused(f"dataset circle: option ids={given}:? {said}", read_options, circle, [("ids", given)], "dataset circle")


def test_one_rendered_log_is_cached_with_ids_and_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    for ids in ("known", "hidden", "0.5"):
        slamduel.load(f"aruco-room[seconds=1,ids={ids}]")
    assert len(list(cache_folder().iterdir())) == 1


def test_a_log_without_ids_goes_to_its_folder_and_back_and_is_dead_reckoned(tmp_path: Path) -> None:
    made = slamduel.load("circle[steps=60,ids=hidden]")
    log_folder.write(tmp_path / "log", made.log, made.truth)
    found = slamduel.load(tmp_path / "log")
    assert found.log.digest == made.log.digest
    np.testing.assert_array_equal(assigned(found), assigned(made))
    assert_dead_reckoned(found.log)


def test_a_table_of_detections_without_ids_is_dead_reckoned(tmp_path: Path) -> None:
    (tmp_path / "odometry.csv").write_text("t,v,omega\n" + "".join(f"{0.1 * k},0.5,0.2\n" for k in range(100)))
    (tmp_path / "detections.csv").write_text(
        "t,id,range,bearing\n"
        + "".join(f"{0.5 * k + 0.05},-1,{2 + bearing},{bearing}\n" for k in range(15) for bearing in (0.1, 0.4))
    )
    log = slamduel.load(f"csv[odometry={tmp_path}/odometry.csv,detections={tmp_path}/detections.csv]").log
    assert log.ids.tolist() == [UNKNOWN] * 30
    assert_dead_reckoned(log)


def assert_dead_reckoned(log: Log) -> None:
    builder = backends.find("ekf")
    run = drive(builder, builder.options(), log, lambda: np.random.default_rng(0))
    assert run.online is not None
    np.testing.assert_allclose(run.online, log.dead_reckoned(), atol=1e-9)
    assert len(run.map.ids) == 0


def test_nothing_is_drawn_where_nothing_is_hidden() -> None:
    rng, plain = np.random.default_rng(0), slamduel.load("circle[steps=20]")
    assert hidden(plain, "known", rng) is plain
    assert rng.uniform() == np.random.default_rng(0).uniform()


def test_ids_that_are_hidden_on_demand_are_no_remark() -> None:
    assert remarks(slamduel.load("circle[ids=hidden]")) == []
