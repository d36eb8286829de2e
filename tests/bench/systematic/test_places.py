"""Known places of landmarks, of which some are wrong."""

import numpy as np

from planted_errors import drive
from slamduel.bench.plan.reference import reference
from slamduel.bench.systematic.places import places_of
from slamduel.core.factors import Map
from slamduel.datasets.noise.systematic import Systematic


def test_exchanged_places_are_put_right_and_one_far_off_is_left_out() -> None:
    log, truth = drive(Systematic(x=0.05), 2, seconds=60)
    best = reference(log)
    assert truth is not None
    assert truth.map is not None
    assert best is not None
    assert best.map is not None
    wrong = truth.map.xy.copy()
    wrong[[3, 7]] = wrong[[7, 3]]
    wrong[11] += 8.0
    found = places_of(log, truth._replace(map=Map(truth.map.ids, wrong, None)), best.map)
    assert found is not None
    assert found.ids.tolist() == [k for k in truth.map.ids.tolist() if k != 11 and k in best.map.ids]
    np.testing.assert_array_equal(found.xy, truth.map.xy[found.ids])


def test_few_or_estimated_places_are_none() -> None:
    log, truth = drive(Systematic(), 2, seconds=20)
    assert truth is not None
    assert truth.map is not None
    known = truth.map
    assert places_of(log, None, known) is None
    assert places_of(log, truth._replace(places="reference"), known) is None
    few = Map(known.ids[:4], known.xy[:4], None)
    assert places_of(log, truth._replace(map=few), known) is None
    assert places_of(log, truth, known) is not None
