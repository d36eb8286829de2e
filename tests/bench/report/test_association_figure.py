"""The figure of data association: mistakes as counted by hand."""

import numpy as np

from slamduel.bench.report.association_figure import mistakes
from slamduel.bench.report.drawn_log import Trace
from slamduel.bench.words.styles import looks
from slamduel.core.se2 import Ints


def _trace(**arrays: Ints) -> Trace:
    return Trace("ekf", "ekf", looks(["ekf"])["ekf"], True, arrays)


def test_mistakes_are_the_sightings_of_other_landmarks_and_the_beginnings_of_doubles() -> None:
    true = np.array([4, 4, 5, 4, 5, 4, 4, -1, 5])
    assigned = np.array([-2, -2, -3, -3, -3, -4, -4, -5, -1])
    found = mistakes(_trace(assigned=assigned), true)
    assert found.wrong.tolist() == [3]
    assert found.other.tolist() == [5]
    assert found.double.tolist() == [5]  # -4 is landmark 4, which -2 is already
    assert (found.dropped, found.used) == (1, 8)
    assert found.words == "12.5 % wrong, 1 double, 1 dropped"


def test_an_association_that_is_known_only_at_the_end_is_judged_at_the_end() -> None:
    true = np.array([1, 2, 1])
    assert mistakes(_trace(final_assigned=np.array([-2, -2, -2])), true).wrong.tolist() == [1]


def test_without_a_sighting_that_is_used_nothing_is_wrong() -> None:
    found = mistakes(_trace(assigned=np.full(3, -1)), np.array([1, 2, 1]))
    assert (len(found.wrong), len(found.double), found.dropped, found.used) == (0, 0, 3, 0)
