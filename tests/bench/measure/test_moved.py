"""Columns and remarks of landmarks that were taken out."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from slamduel.backends.api import TakenOut
from slamduel.bench.measure.association import moved
from slamduel.bench.measure.drive import Outcome
from slamduel.core.factors import Log, Map, Truth
from slamduel.core.se2 import Ints


def outcome(moved: list[int], misread: int = 0, assigned: Ints | None = None) -> Outcome:
    found = SimpleNamespace(taken_out=TakenOut(np.array(moved, np.int64), misread), assigned=assigned)
    return cast(Outcome, cast(Any, found))


def log(ids: list[int]) -> Log:
    return cast(Log, cast(Any, SimpleNamespace(ids=np.array(ids, np.int64))))


def truth(moving: list[int], assigned: list[int] | None = None) -> Truth:
    known = Map(np.arange(20), np.zeros((20, 2)), None)
    given = None if assigned is None else np.array(assigned, np.int64)
    return Truth(np.zeros(0), np.zeros((0, 3)), known, given, moving=np.array(moving, np.int64))


def test_movers_that_were_found_and_standing_landmarks_that_were_taken_out_are_counted() -> None:
    seen, right = log([3, 7, 12, 3, 5, 7, 12, 3, 7, 12]), truth([3, 7, 5, 19])
    found = outcome([12, 3, 7], 2)
    row = moved(seen, found, right)[0]
    assert row == {"moved_out": 3, "moved_false": 1, "moved_found": 2 / 3, "misread_share": 0.2}
    assert moved(log([1]), found, right)[1] == [
        "took out landmarks 3, 7 and 12 as moved: 3 and 7 do move, 12 stands",
        "left out 2 sightings as misread",
    ]


def test_where_the_places_are_not_known_nothing_is_said_of_right_and_wrong() -> None:
    assert moved(log([1, 2]), outcome([2]), None)[0] == {"moved_out": 1, "misread_share": 0.0}
    assert moved(log([1]), outcome([2]), None)[1] == ["took out landmark 2 as moved"]
    assert moved(log([1]), outcome([], 1), None)[1] == ["left out 1 sighting as misread"]
    assert moved(log([1]), outcome([2]), truth([2]))[1] == ["took out landmark 2 as moved: 2 does move"]


def test_a_made_up_id_is_that_of_the_landmark_of_most_of_its_sightings() -> None:
    assigned = np.array([-2, -2, -2, -3, -3])
    found, right = outcome([-2], assigned=assigned), truth([4], [4, 4, 9, 9, 9])
    assert moved(log([-1] * 5), found, right)[0]["moved_found"] == 1
    assert moved(log([1]), found, right)[1] == ["took out landmark 4 as moved: 4 does move"]


def test_a_backend_that_takes_nothing_out_has_no_such_columns() -> None:
    plain = cast(Outcome, cast(Any, SimpleNamespace(taken_out=None)))
    assert moved(log([1]), plain, None)[0] == {}
    assert moved(log([1]), plain, None)[1] == []
