"""Tests the constant errors that backends estimate: values, standard deviations, and the files they end in."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from slamduel.backends import registry
from slamduel.bench.check.parts import SCALE, halves, longer
from slamduel.bench.check.small_logs import around, drive
from slamduel.bench.measure.constants import KINDS, OF_ALL, column, constants
from slamduel.bench.measure.drive import Outcome
from slamduel.bench.measure.drive import drive as driven
from slamduel.bench.words.columns import METRICS
from slamduel.core.factors import CONSTANTS_NOTE, Log

FILTERS = ("ekf", "invariant-ekf", "ukf")


def ranging(seed: int) -> Log:
    """Ranges and bearings alone, ranges too long."""
    return longer(halves(drive(np.random.default_rng(seed), around(170)).log), SCALE)


def outcome(name: str, log: Log, **options: Any) -> Outcome:
    """That of a backend."""
    builder = registry.find(name)
    return driven(builder, builder.options(**options), log, lambda: np.random.default_rng(5))


@pytest.fixture(scope="module")
def batch() -> tuple[Log, np.ndarray]:
    """A log, and the estimates of the batch optimum."""
    log = ranging(3)
    return log, constants(log, outcome("graph", log), None)[1]["constants"]


def test_the_optimum_states_what_gtsam_does(batch: tuple[Log, np.ndarray]) -> None:
    """GTSAM's factors and marginals give the same estimate and standard deviation."""
    log, found = batch
    kind, landmark, value, sd, true = found[0]
    assert (KINDS[int(kind)], landmark, len(found)) == ("range_scale", OF_ALL, 1)
    assert np.isnan(true)
    other = constants(log, outcome("graph", log, solver="gtsam"), None)[1]["constants"][0]
    assert other[2] == pytest.approx(value, abs=1e-2 * sd)
    assert other[3] == pytest.approx(sd, rel=1e-3)


@pytest.mark.parametrize("name", ["ekf", "graph", "fixed-lag"])
def test_the_deviation_is_that_of_the_errors(name: str) -> None:
    """Over twelve logs the squared errors are as large as stated: within the 99.9 % band of their sum."""
    found = [constants(log, outcome(name, log), None)[0] for log in map(ranging, range(20, 32))]
    squared = sum(((row["range_scale"] - SCALE) / row["range_scale_sd"]) ** 2 for row in found)
    low, high = chi2.ppf((0.0005, 0.9995), len(found))
    assert low < squared < high


@pytest.mark.parametrize("name", [*FILTERS, "smoother", "isam2"])
def test_all_backends_agree_with_the_optimum(name: str, batch: tuple[Log, np.ndarray]) -> None:
    """Value within half an sd, sd within a tenth."""
    log, best = batch
    row, arrays = constants(log, outcome(name, log), None)
    (_, _, value, sd, _), (_, _, least, stated, _) = arrays["constants"][0], best[0]
    assert abs(value - least) < 0.5 * stated
    assert sd == pytest.approx(stated, rel=0.1)
    assert (row["range_scale"], row["range_scale_sd"]) == (value, sd)


@pytest.mark.parametrize("name", ["ekf", "graph", "smoother"])
def test_each_landmark_has_its_own(name: str) -> None:
    """One row a landmark, in the order of the map; the row of the cell has medians."""
    log = ranging(4)
    log = replace(log, prior=log.prior._replace(systematic=log.prior.systematic._replace(each=True)))
    found = outcome(name, log)
    row, arrays = constants(log, found, None)
    table, ids = arrays["constants"], (found.map if found.solution is None else found.solution.map).ids
    assert table[:, 1].tolist() == ids.tolist()
    assert (np.abs(table[:, 2] - SCALE) < 6 * table[:, 3]).all()
    assert row["range_scale"] == np.median(table[:, 2])


def test_the_truth_is_what_the_world_has_drawn() -> None:
    """It is noted by name."""
    log = replace(ranging(3), notes={CONSTANTS_NOTE: {"range_scale": SCALE}})
    row, _ = constants(log, outcome("ekf", log), None)
    assert row["range_scale_true"] == SCALE


def test_columns_and_files_name_the_same_constants() -> None:
    """The columns of metrics.csv are those of the kinds, in order, for each its estimate, sd and true value."""
    expected = [column(k, suffix) for k in range(len(KINDS)) for suffix in ("", "_sd", "_true")]
    assert [one.name for one in METRICS[-len(expected) :]] == expected


def test_a_log_without_constant_errors_has_none() -> None:
    """No columns, no array."""
    log = halves(drive(np.random.default_rng(3), around(50)).log)
    assert constants(log, outcome("ekf", log), None) == ({}, {})
