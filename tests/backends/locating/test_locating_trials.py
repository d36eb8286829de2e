"""An unknown start on maps of six kinds, without ids, against Monte Carlo localisation."""

import pytest

from locating_trials import FOUND_AGAIN, MAPS, PARTICLES, WORLDS, another, found_again, search, trial
from tiers import first_quick

EVERY = first_quick(sorted(MAPS, key="aruco-robot".__ne__))
LOCATE = "dead-reckoning"
"""The backend behind: what it says is the pose found, and odometry from there."""


@pytest.mark.parametrize("name", EVERY)
def test_a_robot_is_found_anywhere_and_never_at_a_wrong_place(name: str) -> None:
    made = trial(name)
    said = [search(LOCATE, made, start).said for start in made.starts]
    # 24 starts at a rate of 95 %: three or more are missed once in nine times, five or more once in 200.
    assert said.count("right") >= 20
    assert "wrong" not in said


@pytest.mark.parametrize("name", EVERY)
def test_on_maps_of_other_worlds_it_is_silent(name: str) -> None:
    made = trial(name, 6)
    others = [another(made.given, seed) for seed in range(6)]
    assert [search(LOCATE, made, *one).said for one in zip(made.starts, others, strict=True)] == 6 * ["silent"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(MAPS))
def test_monte_carlo_localisation_is_less_often_right_or_sure_where_there_is_nothing(name: str) -> None:
    made = trial(name, 6)
    assert PARTICLES == 10_000
    right = [[search(one, made, start).said == "right" for start in made.starts] for one in (LOCATE, "mcl")]
    assert sum(right[0]) >= sum(right[1])
    others = [another(made.given, seed) for seed in range(6)]
    sure = [search("mcl", made, *one).said != "silent" for one in zip(made.starts, others, strict=True)]
    assert any(sure)


@pytest.mark.slow
@pytest.mark.parametrize("ids", [True, False])
@pytest.mark.parametrize("world", list(WORLDS))
def test_a_robot_carried_elsewhere_is_found_again_with_and_without_ids(world: str, ids: bool) -> None:
    taken = [found_again(world, seed, ids=ids) for seed in range(100, 106)]
    assert None not in taken
    assert max(steps for steps in taken if steps is not None) <= FOUND_AGAIN
