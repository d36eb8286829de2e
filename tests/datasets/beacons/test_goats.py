"""The dives in GTSAM's wheel."""

import numpy as np
import pytest

from slamduel.bench.plan.load import load
from slamduel.core.factors.check import problems


@pytest.mark.parametrize(("number", "steps", "ranges", "beacons"), [(15, 473, 786, 3), (16, 201, 572, 4)])
def test_a_dive_has_its_ranges_and_no_truth(number: int, steps: int, ranges: int, beacons: int) -> None:
    log, truth = load(f"goats[log={number}]")
    assert truth is None
    assert log.partial is not None
    assert list(problems(log)) == []
    assert (len(log), len(log.partial), len(np.unique(log.partial.ids))) == (steps, ranges, beacons)
    assert set(log.partial.var.tolist()) == {0.75**2}
    assert not log.prior.pose.any()
    told, _ = load(f"goats[log={number},range_sd=3]")
    assert told.partial is not None
    assert set(told.partial.var.tolist()) == {9.0}
    assert told.digest != log.digest
