"""A cell's columns: online and final apart, nothing where nothing is known, and every log scored without a warning."""

import csv
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from csv_rows import csv_rows
from random_logs import random_log
from slamduel.backends.api import Solution
from slamduel.bench.bound.bound import Bound
from slamduel.bench.measure.accuracy import Alignment, aligned, ate
from slamduel.bench.measure.constants import KINDS
from slamduel.bench.measure.cpu_time import step_cost
from slamduel.bench.measure.drive import Outcome
from slamduel.bench.measure.score import SHAPELESS, TRANSLATION_ONLY, score
from slamduel.bench.record.files import export
from slamduel.bench.record.schema import COLUMNS, MORE
from slamduel.bench.words.columns import DEADLINES_MS, FINAL, MACHINE, ONLINE
from slamduel.core.factors import Log, Map, Truth
from slamduel.core.se2 import Array, compose
from small_record import Record

NO_MAP = Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)


def uncertain(landmarks: Map) -> Map:
    return landmarks._replace(cov=0.04 * np.eye(2 * len(landmarks.ids)))


def outcome(online: Array | None, landmarks: Map, solution: Solution | None = None) -> Outcome:
    """Of a backend that is sure to 0.2 m and 0.1 rad, took 1 ms and 1 µs more every step, and 2 s to finish."""
    path = online if solution is None else solution.path
    assert path is not None
    n = len(path)
    ns = 1_000_000 + 1000 * np.arange(n)
    cov = np.tile(np.diag([0.04, 0.04, 0.01]), (n, 1, 1)) if online is not None else np.full((n, 3, 3), np.nan)
    unknown, none = np.full(n, np.nan), np.zeros(n, np.int64)
    return Outcome(
        online=online, cov=cov, nis=unknown, nis_dof=none, n_eff=unknown, ancestors=unknown, refused=none,
        located=none == 0, map=landmarks, solution=solution, step_ns=ns, wall_ns=ns, belief_ns=ns, map_ns=0,
        setup_ns=0, finish_ns=2_000_000_000, clock_ns=0, told=False,
    )  # fmt: skip


@cache
def drive(seed: int = 1, steps: int = 400, dt: float = 0.1) -> tuple[Log, Truth, Map]:
    log, truth = random_log(np.random.default_rng(seed), steps, 12)
    assert truth is not None
    assert truth.map is not None
    t = dt * np.arange(steps)
    again = Log.from_steps("drive", log.prior, [step._replace(t=at) for step, at in zip(log, t, strict=True)])
    return again, truth._replace(t=again.t), truth.map


def all_known(row: dict[str, Any]) -> bool:
    return all(value is None or isinstance(value, str) or np.isfinite(value) for value in row.values())


ASSOCIATION = re.compile(
    r"(final_)?(pair_\w+|wrong_share|dropped_share|landmarks_(merged|double|clutter))|associate_\w+|nodes_max"
    r"|moved_\w+|misread_share"
)


def test_a_perfect_estimate_has_no_error_and_no_gap() -> None:
    log, truth, known = drive()
    seen = np.isin(known.ids, log.ids)
    found = uncertain(Map(known.ids[seen], known.xy[seen], None))
    cov = np.tile(0.01 * np.eye(3), (len(log), 1, 1))
    row = score(log, outcome(truth.poses, found, Solution(truth.poses, found, cov)), truth).row
    assert all_known(row)
    ones = {name for name in row if name.endswith("nees_inside")}
    errors = {"ate_m", "ate_origin_m", "heading_rad", "map_rmse_m", "nees", "landmark_nees", "landmarks_missed"}
    errors |= {"landmarks_spurious", "align_x_m", "align_y_m", "align_rad", "rpe_m", "rpe_10m_m", "rpe_100m_m"}
    errors |= {"rpe_1s_m", "rpe_10s_m", "rpe_rad", "ate_median_m"}
    for name in errors | {f"final_{name}" for name in errors}:
        assert row[name] == pytest.approx(0, abs=1e-12), name
    assert len(ones) == 4
    assert all(row[name] == 1 for name in ones)
    assert set(row) <= {*COLUMNS, *MORE}
    untold = {"n_eff_least", "ancestors_left", "refused_share", "j_online", "told", "reference", "no_bound"}
    untold |= {"j_loops", "loops_rejected", "loop_precision", "loop_recall"}  # no loop is closed
    untold |= {"located_share", "wrong_fix_share", "locate_steps", "locate_ms"}  # the start is known
    untold |= {name for name in MORE if ASSOCIATION.fullmatch(name)}  # so are all ids, and nothing is taken out
    untold |= {name for name in MORE if "relation" in name}  # the path itself is
    untold |= {name for name in MORE if any(name.startswith(kind) for kind in KINDS)}  # it has no constant errors
    few = {"growth_landmarks", "growth_landmarks_se"}  # all twelve landmarks are sighted early on
    few |= {column.name for column in MACHINE} | {"cpu_low_s", "cpu_high_s", "step_us_p50_low", "step_us_p50_high"}
    few |= {name for name in MORE if name.startswith("slope_")}  # of a long log
    few |= {"log_name", "cluster"}  # of the plan
    few |= {"over_bound", "final_over_bound", "bound_origin_m", "final_bound_origin_m"}  # of the log, which is not told
    assert {*MORE} - set(row) == untold | few


def test_a_few_bad_fixes_do_not_move_the_median_error() -> None:
    log, truth, _ = drive()
    rng = np.random.default_rng(5)
    path = truth.poses + rng.normal(0, 0.02, truth.poses.shape)
    plain = score(log, outcome(path, NO_MAP), truth).row
    poses = truth.poses.copy()
    poses[:: len(poses) // 4, :2] += 3.0  # four or five of them
    odd = score(log, outcome(path, NO_MAP), truth._replace(poses=poses)).row
    assert odd["ate_m"] > 5 * plain["ate_m"]
    assert plain["ate_median_m"] == pytest.approx(0.02 * np.sqrt(2 * np.log(2)), rel=0.2)  # of Rayleigh's distribution
    assert odd["ate_median_m"] < 3 * plain["ate_median_m"] + 3.0 * 5 / len(poses)  # alignment follows their mean


def test_online_and_final_are_never_mixed() -> None:
    log, truth, known = drive()
    rng = np.random.default_rng(2)
    off = truth.poses + rng.normal(0, 0.3, truth.poses.shape)
    good = truth.poses + rng.normal(0, 0.01, truth.poses.shape)
    rough, fine = uncertain(known._replace(xy=known.xy + 0.5)), uncertain(known._replace(xy=known.xy + 0.1))
    cov = np.tile(1e-4 * np.eye(3), (len(log), 1, 1))
    both = score(log, outcome(off, rough, Solution(good, fine, cov)), truth)
    online = score(log, outcome(off, rough), truth)
    batch = score(log, outcome(None, NO_MAP, Solution(good, fine, cov)), truth)
    judged = {column.name for column in ONLINE}
    apart = {"cost_j", "landmarks", "j_online", "j_final", "j_prior", "j_odometry", "j_sightings"}  # of the final alone
    for name in (*COLUMNS, *MORE):
        if name in apart:
            continue
        whole, alone = (batch, online) if name.startswith("final_") else (online, batch)
        assert both.row.get(name) == whole.row.get(name)
        accuracy = name.removeprefix("final_") in {*judged, "ate_m", "nees", "heading_rad", "map_rmse_m"}
        assert not accuracy or alone.row.get(name) is None, name
    assert both.row["landmark_nees"] == pytest.approx(0.5**2 / 0.04)
    assert both.row["final_landmark_nees"] == pytest.approx(0.1**2 / 0.04)
    assert both.row["final_nees"] == pytest.approx(1, abs=6 * np.sqrt(2 / 3 / len(log)))
    assert both.row["final_rpe_m"] < 0.1 * both.row["rpe_m"]
    assert both.arrays["final_nees"].mean() == pytest.approx(3 * both.row["final_nees"])


def test_the_alignment_that_is_recorded_is_the_one_that_was_used() -> None:
    log, truth, known = drive()
    turned = compose(np.broadcast_to((3.0, -2.0, 0.5), truth.poses.shape), truth.poses)
    turned[:, :2] += np.random.default_rng(3).normal(0, 0.1, (len(log), 2))
    row = score(log, outcome(turned, known, Solution(truth.poses, known)), truth).row
    motion = np.array([row["align_x_m"], row["align_y_m"], row["align_rad"]])
    assert ate(aligned(Alignment(motion, False), turned), truth.poses) == pytest.approx(row["ate_m"], rel=1e-12)
    assert row["align_rad"] == pytest.approx(-0.5, abs=0.02)
    assert [row[f"final_align_{name}"] for name in ("x_m", "y_m", "rad")] == pytest.approx([0, 0, 0], abs=1e-12)
    assert "final_nees" not in row  # the smoother gives no covariances


def test_costs_by_fifths_and_against_the_time_of_the_log() -> None:
    log, truth, known = drive(steps=400, dt=0.1)
    row = score(log, outcome(truth.poses, known), truth).row
    fifths = [row[f"step_us_fifth{k}"] for k in range(1, 6)]
    assert fifths == pytest.approx(1000 + 39.5 + 80 * np.arange(5))
    assert np.mean(fifths) == pytest.approx(row["step_us_mean"])
    assert row["length_s"] == pytest.approx(39.9)
    assert row["real_time"] == pytest.approx(1e-6 * row["step_us_mean"] * 400 / 39.9)


def test_steps_above_deadlines_and_late_ones_are_counted_once_each() -> None:
    log, truth, known = drive(steps=400, dt=0.1)
    us = np.full(400, 500.0)
    us[:40], us[40:60], us[60], us[-1] = 1000.0, 2000.0, 99_000.0, 150_000.0  # 1 ms is not above 1 ms
    row = score(log, replace(outcome(truth.poses, known), step_ns=(1000 * us).astype(np.int64)), truth).row
    assert [row[f"over_{ms}ms"] for ms in DEADLINES_MS] == [22 / 400, 2 / 400, 1 / 400]
    assert row["late_share"] == 0  # nothing waits for the last step
    us[61] = 150_000.0
    late = score(log, replace(outcome(truth.poses, known), step_ns=(1000 * us).astype(np.int64)), truth).row
    assert late["late_share"] == pytest.approx(1 / 399)


def test_growth_since_the_map_is_whole_is_apart_from_the_growth_of_the_map() -> None:
    log, truth, known = drive(steps=1500)
    number = 1 + np.arange(1500)
    whole = step_cost(log, outcome(truth.poses, known))["whole_from"]
    assert 0 < whole < 300  # in the first fifth
    us = np.where(number > whole, 10.0 * number**0.5, 0.1)
    row = step_cost(log, replace(outcome(truth.poses, known), step_ns=(1000 * us).astype(np.int64)))
    ends = [row[f"slope_steps{end}"] for end in ("", "_low", "_high")]
    assert ends == pytest.approx([0.5, 0.5, 0.5], abs=1e-4)
    assert row["last_over_whole"] == pytest.approx((1350 / 450) ** 0.5, rel=0.01)
    assert row["last_over_first"] > row["last_over_whole"]


def test_where_times_are_step_numbers_nothing_is_told_over_seconds() -> None:
    log, truth, known = drive(dt=1.0)
    row = score(log, outcome(truth.poses, known), truth).row
    assert {"length_s", "real_time", "late_share", "rpe_1s_m", "rpe_10s_m"}.isdisjoint(row)
    assert row["rpe_10m_m"] == pytest.approx(0, abs=1e-12)


def test_what_goes_on_inside_is_told_where_it_is_known() -> None:
    log, truth, known = drive()
    n = len(log)
    telling = replace(
        outcome(truth.poses, known),
        n_eff=np.concatenate(([np.nan, 7.5], np.full(n - 2, 90.0))),
        ancestors=np.append(np.arange(n - 1, 0, -1.0) + 3, 2.0),
        refused=np.where(np.arange(n) == 5, 4, 0),
    )
    row = score(log, telling, truth).row
    assert (row["n_eff_least"], row["ancestors_left"]) == (7.5, 2.0)
    assert row["refused_share"] == 4 / len(log.ids)
    assert row["j_online"] == row["cost_j"] == row["j_prior"] + row["j_odometry"] + row["j_sightings"]
    assert "j_final" not in row


def test_the_reason_of_a_missing_bound_is_in_the_row() -> None:
    log, truth, _ = drive()
    row = score(log, outcome(truth.poses, NO_MAP), truth._replace(map=None)).row
    assert row["no_bound"] == "the landmarks' places are unknown"
    assert "no_bound" not in score(log, outcome(truth.poses, NO_MAP), truth).row
    assert "no_bound" not in score(log, outcome(truth.poses, NO_MAP), None).row


def test_errors_over_their_bounds() -> None:
    log, truth, known = drive()
    off = truth.poses + np.random.default_rng(0).normal(0, 0.1, truth.poses.shape)
    least = Bound(0.05, 0.02, 0.5, 0.4)
    row = score(log, outcome(off, known, Solution(truth.poses, known)), truth, least=least).row
    assert (row["final_bound_m"], row["final_bound_origin_m"]) == (0.02, 0.4)
    assert row["final_over_bound"] == row["final_ate_m"] / 0.02
    online = score(log, outcome(off, known), truth, least=least).row
    assert online["over_bound"] == online["ate_m"] / online["bound_m"] > 1
    assert online["bound_origin_m"] == 0.5
    assert "final_bound_m" not in online
    assert "bound_m" not in score(log, outcome(off, known), truth).row


def test_a_batch_method_has_no_pace() -> None:
    log, truth, known = drive()
    row = score(log, outcome(None, NO_MAP, Solution(truth.poses, known)), truth).row
    assert "length_s" in row
    assert {"real_time", "late_share", "growth_steps", "growth_landmarks", "slope_steps", "over_1ms"}.isdisjoint(row)


def standing(steps: int) -> tuple[Log, Truth, Map]:
    log, truth, known = drive(steps=steps)
    return log, truth._replace(poses=np.tile(truth.poses[:1], (steps, 1))), known


ODD = {
    "one step": drive(steps=1),
    "two steps": drive(steps=2),
    "standing": standing(30),
    "landmarks unknown": (drive()[0], drive()[1]._replace(map=None), drive()[2]),
    "part of the truth": (
        drive()[0],
        drive()[1]._replace(t=drive()[0].t[:50], poses=drive()[1].poses[:50]),
        drive()[2],
    ),
    "another frame": (drive()[0], drive()[1]._replace(kind="reference", places="truth"), drive()[2]),
    "a map alone": (drive()[0], drive()[1]._replace(t=np.zeros(0), poses=np.zeros((0, 3))), drive()[2]),
    "no truth": (drive()[0], None, drive()[2]),
}


@pytest.mark.parametrize("case", ODD)
@pytest.mark.parametrize("mapping", [True, False])
def test_every_log_is_scored(case: str, mapping: bool) -> None:
    log, truth, known = ODD[case]
    rng = np.random.default_rng(4)
    path = rng.normal(0, 1, (len(log), 3))
    landmarks = uncertain(known) if mapping else NO_MAP
    cov = np.tile(np.eye(3), (len(log), 1, 1))
    for one in (outcome(path, landmarks), outcome(None, NO_MAP, Solution(path, landmarks, cov))):
        judged = score(log, one, truth)
        assert all_known(judged.row)
        assert set(judged.row) <= {*COLUMNS, *MORE}
        prefix = "" if one.solution is None else "final_"
        shapeless = case in ("one step", "two steps", "standing")
        assert (SHAPELESS in judged.remark) == shapeless
        assert TRANSLATION_ONLY not in judged.remark
        if truth is not None and len(truth.t):
            assert (f"{prefix}ate_m" not in judged.row) == shapeless
            assert f"{prefix}ate_origin_m" in judged.row
            assert f"{prefix}heading_rad" in judged.row
        if case == "another frame":
            assert f"{prefix}landmark_nees" not in judged.row
            assert f"{prefix}nees" not in judged.row
        if case == "a map alone":
            assert f"{prefix}ate_m" not in judged.row
            assert judged.row[f"{prefix}landmarks_spurious"] == 0
        if case == "no truth":
            of_truth = {column.name for column in (*ONLINE, *FINAL) if not column.name.endswith("_void")}
            assert not of_truth & set(judged.row)


def test_a_row_says_what_its_errors_are_measured_from() -> None:
    log, truth, known = drive()
    from_reference = truth._replace(kind="reference", words="the batch optimum with a Cauchy loss")
    for one, surveyed, reference in (
        (truth, 0, None),
        (from_reference._replace(places="reference"), 0, from_reference.words),
        (from_reference._replace(places="truth"), 1, from_reference.words),
    ):
        judged = score(log, outcome(truth.poses, known), one)
        assert (judged.row["surveyed"], judged.row.get("reference")) == (surveyed, reference)
        assert judged.remark == ""


def test_metrics_csv_names_the_cell_and_has_every_column(tmp_path: Path) -> None:
    out = tmp_path / "run"
    record = Record(out)
    record.cell("room", "truth", "ekf", seed=3, paths=("final",), rpe_10m_m=0.25, landmarks_missed=2)
    record.failed("room", "truth", "isam2", "diverged", "lost", seed=3)
    export(record.store)
    rows = csv_rows(out / "metrics.csv")
    key = ("dataset", "dataset_options", "backend", "options", "seed")
    assert tuple(rows[0]) == (*key, *MORE)
    assert [(row["backend"], row["seed"], row["rpe_10m_m"], row["landmarks_missed"]) for row in rows] == [
        ("ekf", "3", "0.25", "2"),
        ("isam2", "3", "", ""),
    ]
    with (out / "cells.csv").open(newline="") as file:
        assert tuple(next(csv.reader(file))) == COLUMNS


def test_a_covariance_that_is_none_is_counted_and_remarked_on() -> None:
    log, truth, known = drive()
    good = outcome(truth.poses, uncertain(known))
    assert score(log, good, truth).remark == ""
    assert score(log, good, truth).row["nees_void"] == 0
    cov = good.cov.copy()
    cov[7:10] = 0.0
    flat = known._replace(cov=np.zeros((2 * len(known.ids), 2 * len(known.ids))))
    found = score(log, replace(good, cov=cov, map=flat), truth)
    assert found.row["nees_void"] == 3
    assert found.row["landmark_nees_void"] == len(known.ids)
    assert found.row["nees_inside"] == 397 / 400
    assert "landmark_nees" not in found.row
    landmarks = f"landmark NEES: not a covariance at {len(known.ids)} of {len(known.ids)} landmarks"
    assert found.remark == f"NEES: not a covariance at 3 of 400 steps; {landmarks}"
    final = replace(good, solution=Solution(truth.poses, known, -good.cov))
    assert score(log, final, None).remark == "final NEES: not a covariance at 400 of 400 steps"
