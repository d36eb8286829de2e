"""Logs and truths beyond all sense: nothing raises or warns, and no mistake is named that would not explain them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mistaken_logs import drawn
from slamduel.bench.contradiction.remark import remarked
from slamduel.core.factors import Dataset, Log, Map, Truth
from slamduel.core.se2 import Array

Change = Callable[[Log], Log]


def with_delta(change: Callable[[Array], Array]) -> Change:
    return lambda log: replace(log, delta=np.concatenate((log.delta[:1], change(log.delta[1:].copy()))))


def jumping(delta: Array) -> Array:
    delta[::20] *= 1e8
    return delta


def loops_alone(log: Log) -> Log:
    rng, n = np.random.default_rng(0), len(log)
    step = np.sort(rng.integers(1, n, 60))
    none = slice(0)
    return Log.from_arrays(
        "loops", log.prior, log.t, log.delta, log.delta_cov, log.sighting_step[none], log.ids[none], log.z[none],
        log.z_cov[none], loop_step=step, loop_to=step // 2, loop_delta=1e9 * rng.standard_normal((60, 3)),
        loop_cov=np.tile(np.eye(3), (60, 1, 1)),
    )  # fmt: skip


LOGS: dict[str, Change] = {
    "motions without end": with_delta(lambda delta: delta * 1e200),
    "motions beyond all squares": with_delta(lambda delta: delta * [1e160, 1e160, 1.0]),
    "no motion": with_delta(lambda delta: 0.0 * delta),
    "jumps": with_delta(jumping),
    "ranges near 0": lambda log: replace(log, z=log.z * [1e-12, 1.0]),
    "ranges without end": lambda log: replace(log, z=log.z * [1e200, 1.0]),
    "no noise": lambda log: replace(log, delta_cov=log.delta_cov * 1e-290),
    "all noise": lambda log: replace(log, delta_cov=log.delta_cov * 1e290, z_cov=log.z_cov * 1e290),
    "no noise across": lambda log: replace(log, delta_cov=log.delta_cov * np.diag([1.0, 0.0, 1.0])),
    "one landmark": lambda log: replace(log, ids=np.zeros_like(log.ids)),
    "false loops alone": loops_alone,
    "two steps": lambda log: log.head(2),
    "a step": lambda log: log.head(1),
}

TRUTHS: dict[str, Callable[[Truth], Truth]] = {
    "in one place": lambda truth: truth._replace(poses=0.0 * truth.poses),
    "without end": lambda truth: truth._replace(poses=truth.poses * 1e200),
    "of one step": lambda truth: truth._replace(t=truth.t[:1], poses=truth.poses[:1]),
    "of places alone, in one": lambda truth: truth._replace(
        t=truth.t[:0], poses=truth.poses[:0], map=Map(np.arange(9), np.zeros((9, 2)), None)
    ),
    "of places without end": lambda truth: truth._replace(map=Map(np.arange(9), np.full((9, 2), 1e300), None)),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", LOGS)
def test_no_mistake_is_named_in_a_log_beyond_all_sense(case: str, tmp_path: Path):
    (log, truth), _ = drawn(3001, None, tmp_path)
    odd = LOGS[case](log.head(60))
    kept = None if truth is None else truth._replace(t=truth.t[: len(odd)], poses=truth.poses[: len(odd)])
    assert not [said for said in remarked(Dataset(odd, kept)).contradictions if "J falls" in said]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", TRUTHS)
def test_truth_beyond_all_sense_is_not_explained(case: str, tmp_path: Path):
    (log, truth), _ = drawn(3001, None, tmp_path)
    assert truth is not None
    assert remarked(Dataset(log, TRUTHS[case](truth))).contradictions == []
