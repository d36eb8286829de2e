"""Remarks on logs whose measurements are not as accurate as stated."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import slamduel
from room_drives import room_drive
from slamduel.backends import registry
from slamduel.bench.logs.numbers import described
from slamduel.bench.measure.cell import Job, run_on
from slamduel.bench.measure.score import MISTAKEN, OTHER_WAYS, UNTURNED
from slamduel.bench.measure.stated_noise import OTHER_PLACES, misstated
from slamduel.bench.noise.sightings import sighted
from slamduel.core.factors import Dataset, Log, Map, Truth
from slamduel.core.se2 import Array
from slamduel.core.truth.errors import driven_errors
from slamduel.frontend.markers.noise import ProportionalNoise

OFF = {"nees": 100.0}
"""A belief that is far off."""


def circle(options: str = "") -> tuple[Log, Truth]:
    log, truth = slamduel.load(f"circle[steps=200{options}]")
    assert truth is not None
    return log, truth


@pytest.mark.parametrize("row", [{}, {"nees": None}, {"nees": 1.2}, {"nees": 1.4, "final_nees": 0.4}])
def test_a_belief_that_holds_is_not_looked_into(row: dict[str, float | None]) -> None:
    log, truth = circle(",sensor_scale=5")
    assert list(misstated(log, truth, row)) == []


@pytest.mark.parametrize("row", [OFF, {"nees": 1.0, "final_nees": 0.1}])
def test_noise_as_stated_is_no_reason_for_a_belief_that_is_off(row: dict[str, float | None]) -> None:
    log, truth = circle()
    assert list(misstated(log, truth, row)) == []


@pytest.mark.parametrize("scale", [4.0, 0.25])
def test_errors_of_another_size_than_stated_are_told(scale: float) -> None:
    for option, noun in (("sensor_scale", "sightings"), ("odometry_scale", "motions")):
        log, truth = circle(f",{option}={scale}")
        (remark,) = misstated(log, truth, OFF)
        found = re.match(f"the errors of the {noun} are typically ([0-9.e-]*) times what is stated", remark)
        assert found
        assert float(found[1]) == pytest.approx(scale, rel=0.15)


@pytest.mark.parametrize("scale", [20.0, 0.02])
def test_errors_tenfold_off_are_told_whatever_the_belief(scale: float) -> None:
    for option, noun in (("sensor_scale", "sightings"), ("odometry_scale", "motions")):
        log, truth = circle(f",{option}={scale}")
        for some in (truth, truth._replace(map=None)):
            (remark,) = misstated(log, some, {"nees": 1.0})
            assert remark.startswith(f"the errors of the {noun} are typically ")


@pytest.mark.parametrize(
    ("worst", "words"),
    [
        (0, "most of all forward, {} times (of CSV tables option forward)"),
        (1, "most of all sideways, {} times (of CSV tables option floor_position)"),
        (2, "most of all turn, {} times (of CSV tables options turning and turning_by_turn)"),
    ],
)
def test_the_component_of_motions_that_is_worst_is_named(worst: int, words: str) -> None:
    log, truth = circle()
    smaller = np.full(3, 4.0)
    smaller[worst] = 12.0
    (remark,) = misstated(replace(log, delta_cov=log.delta_cov / np.outer(smaller, smaller)), truth, OFF)
    found = re.search(re.escape(words).replace(r"\{\}", "(.*)"), remark)
    assert found
    assert float(found[1]) == pytest.approx(12, rel=0.2)


def test_a_prior_that_is_not_where_the_robot_is_explains_a_belief_that_is_off() -> None:
    log, truth = circle()
    pose = log.prior.pose + np.array([3.0, 4.0, 0.5])
    moved = replace(log, prior=log.prior._replace(pose=pose, cov=1e-4 * np.eye(3)))
    (remark,) = misstated(moved, truth, OFF)
    assert remark.startswith("the log's prior is 5 m and 0.5 rad off the true pose, ")
    assert list(misstated(moved, truth, {"nees": 1.0})) == []


@pytest.mark.parametrize("with_map", [True, False])
def test_gross_errors_are_counted(with_map: bool) -> None:
    log, truth = circle()
    z = log.z.copy()
    z[[3, 50], 1] += 1.0
    right = truth if with_map else truth._replace(map=None)
    (remark,) = misstated(replace(log, z=z), right, OFF)
    assert remark.startswith(f"2 of {len(log.ids)} sightings are off by more than 7 stated standard deviations, by ")


def test_a_very_large_error_is_a_plain_number() -> None:
    log, truth = circle()
    z = log.z.copy()
    z[3, 0] += 1000 * np.sqrt(log.z_cov[3, 0, 0])
    (remark,) = misstated(replace(log, z=z), truth, OFF)
    assert re.search(r" is off by more than 7 stated standard deviations, by (990|1,000|1,100) at most$", remark)


def test_single_errors_are_no_reason_for_a_cautious_belief() -> None:
    log, truth = circle()
    z = log.z.copy()
    z[3, 1] += 1.0
    moved = replace(log, z=z, prior=log.prior._replace(pose=log.prior.pose + 1.0, cov=1e-4 * np.eye(3)))
    assert len(list(misstated(moved, truth, OFF))) == 2
    assert list(misstated(moved, truth, {"nees": 0.1})) == []


def test_a_wrong_id_is_an_error_of_its_sighting() -> None:
    log, truth = circle(",wrong_ids=0.1")
    (remark,) = misstated(log, truth, OFF)
    assert 1 <= int(remark.split()[0]) <= np.sum(truth.assigned != log.ids)


def stated(log: Log, sd: Array) -> Log:
    """The log with the standard deviations of its sightings times `sd` (s,)."""
    return replace(log, z_cov=log.z_cov * sd[:, None, None] ** 2)


def test_noise_that_is_uneven_by_landmark_says_for_which() -> None:
    """Half of the landmarks have five times too much stated, the others too little: mean and median disagree."""
    log, truth = circle()
    sharp = np.unique(log.ids)[::2]
    sd = np.where(np.isin(log.ids, sharp), 5.0, 0.6)
    (remark,) = misstated(stated(log, sd), truth, OFF)
    found = re.fullmatch(
        r"the stated noise of the sightings is uneven: too much for landmarks ([\d, ]+) and (\d+) more, whose errors "
        r"are (.*) times what is stated, and too little for landmarks .*, whose errors are (.*) times what is stated",
        remark,
    )
    assert found[1].split(", ") == [str(name) for name in sharp[:6]]
    assert int(found[2]) == len(sharp) - 6
    scales = np.array([float(found[3]), float(found[4])])
    np.testing.assert_allclose(scales, [1 / 5.0, 1 / 0.6], rtol=0.15)
    # What it says is right: stated so, nothing is left to remark on.
    assert list(misstated(stated(log, sd * np.where(sd > 1, *scales)), truth, OFF)) == []


def test_noise_that_is_uneven_by_distance_says_up_to_where() -> None:
    log, truth = circle()
    limit = float(np.median(log.z[:, 0]))
    (remark,) = misstated(stated(log, np.where(log.z[:, 0] < limit, 6.0, 0.6)), truth, OFF)
    found = re.fullmatch(
        r"the stated noise of the sightings is uneven: too much for landmarks within (.*) m, whose errors are (.*) "
        r"times what is stated, and too little for those beyond, whose errors are (.*) times what is stated",
        remark,
    )
    assert float(found[1]) == pytest.approx(limit, rel=0.05)
    assert float(found[2]) == pytest.approx(1 / 6, rel=0.15)
    assert float(found[3]) == pytest.approx(1 / 0.6, rel=0.15)


def test_tails_that_nothing_explains_are_told_with_both_sizes() -> None:
    log, truth = circle()
    odd = np.random.default_rng(5).uniform(size=len(log.ids)) < 0.5
    (remark,) = misstated(stated(log, np.where(odd, 8.0, 0.8)), truth, OFF)
    assert re.fullmatch(
        r"the errors of the sightings are typically 0.2\d* times what is stated, but 0.[89]\d* times in the root mean "
        r"square: some are much larger than the rest",
        remark,
    )


@pytest.mark.parametrize("row", [OFF, {"nees": 1.0}])
def test_sightings_are_no_reason_for_a_backend_that_uses_none(row: dict[str, float | None]) -> None:
    log, truth = circle(",sensor_scale=20")
    assert len(list(misstated(log, truth, row))) == 1
    assert list(misstated(log, truth, row, sightings=False)) == []
    log, truth = circle(",odometry_scale=20")
    (remark,) = misstated(log, truth, row, sightings=False)
    assert remark.startswith("the errors of the motions are typically ")


def test_the_cell_of_dead_reckoning_is_silent_on_sightings_and_that_of_the_ekf_is_not() -> None:
    log, truth = circle(",sensor_scale=20")
    said = {}
    for name in ("dead-reckoning", "ekf"):
        job = Job(name, name, registry.find(name).options(), 0, 8000)
        said[name] = run_on(job, lambda: log, lambda: truth).reason
    assert "sightings" not in said["dead-reckoning"]
    assert "the errors of the sightings are typically " in said["ekf"]


@pytest.mark.parametrize(
    "dataset", ["circle", "bailey", "linear", "matlab-report", "aruco-robot", "city[landmarks=150,steps=300]"]
)
def test_worlds_by_default_have_no_remark_whatever_the_belief(dataset: str) -> None:
    log, truth = slamduel.load(dataset)
    assert truth is not None
    for row in (OFF, {"nees": 0.01}, {"nees": 1.0}):
        assert list(misstated(log, truth, row)) == []


def test_the_room_has_no_remark_and_with_one_constant_for_all_heights_it_is_uneven() -> None:
    """Ids below 12 are on the floor, where 8 mm and 3 mrad are much too much."""
    made, truth = room_drive(2)
    assert list(misstated(made.log, truth, OFF)) == []
    flat = ProportionalNoise(0.002, 0.002, 0.008, 0.003).cov(made.log.z)
    (remark,) = misstated(replace(made.log, z_cov=flat), truth, OFF)
    found = re.search(r"uneven: too much for landmarks ([\d, ]+)", remark)
    assert all(int(name) < 12 for name in found[1].split(", "))


@pytest.mark.parametrize("jitter", [0.0, 1e-6])
def test_a_robot_that_stands_most_of_the_time_is_judged_by_the_steps_it_drives(jitter: float) -> None:
    log, truth = circle()
    stood = 10 * len(log)
    jump = np.diff(log.t).mean()
    still = np.tile([0.0, 0.0, 0.0], (stood, 1)) + jitter * np.random.default_rng(3).standard_normal((stood, 3))
    t = np.concatenate((log.t, log.t[-1] + jump * np.arange(1, stood + 1)))
    cov = np.concatenate((log.delta_cov, np.tile(log.delta_cov[-1:], (stood, 1, 1))))
    long = Log.from_arrays(
        "long", log.prior, t, np.concatenate((log.delta, still)), cov, log.sighting_step, log.ids, log.z, log.z_cov
    )
    known = truth._replace(t=t, poses=np.concatenate((truth.poses, np.tile(truth.poses[-1:], (stood, 1)))))
    assert len(driven_errors(long, known).row) == len(log) - 1
    for row in (OFF, {"nees": 0.01}, {"nees": 1.0}):
        assert list(misstated(long, known, row)) == []
    (remark,) = misstated(replace(long, delta_cov=cov / 400), known, OFF)
    assert remark.startswith("the errors of the motions are typically ")


def test_frozen_odometry_of_a_robot_that_drives_counts() -> None:
    log, truth = circle()
    frozen = replace(log, delta=np.where(np.isnan(log.delta), log.delta, 0.0))
    assert len(driven_errors(frozen, truth).row) == len(log) - 1
    stands = truth._replace(poses=np.tile(truth.poses[:1], (len(log), 1)))
    assert len(driven_errors(frozen, stands).row) == 0


ELSEWHERE: dict[str, Callable[[Map], Map]] = {
    "shifted": lambda known: known._replace(xy=known.xy + np.array([30.0, 10.0])),
    "a little shifted": lambda known: known._replace(xy=known.xy + np.array([1.5, -1.0])),
    "millimetres": lambda known: known._replace(xy=1000 * known.xy),
    "mirrored": lambda known: known._replace(xy=known.xy[:, ::-1]),
    "renumbered": lambda known: known._replace(ids=np.roll(known.ids, len(known.ids) // 3)),
}


@pytest.mark.parametrize("case", ELSEWHERE)
def test_landmarks_that_are_elsewhere_blame_no_noise(case: str) -> None:
    """Sightings are compared with the places that they have themselves, as where no true ones are known."""
    log, truth = circle()
    assert truth.map is not None
    wrong = truth._replace(map=ELSEWHERE[case](truth.map))
    for row in ({"nees": 1.0}, OFF):
        assert list(misstated(log, wrong, row)) == [OTHER_PLACES]
    unknown = truth._replace(map=None)
    np.testing.assert_array_equal(sighted(log, wrong).error, sighted(log, unknown).error)
    shows = [described("", Dataset(log, one), None).numbers.known for one in (wrong, unknown)]
    assert shows[0].medians
    assert shows[0].sightings == shows[1].sightings
    assert OTHER_PLACES not in list(misstated(*circle(",sensor_scale=50"), OFF))


@pytest.mark.parametrize("case", ["headings", "millimetres"])
def test_a_truth_that_cannot_be_the_logs_blames_no_noise(case: str) -> None:
    log, truth = circle()
    poses = truth.poses * ([1, 1, 0] if case == "headings" else [1000, 1000, 1])
    job = Job("ekf", "ekf", registry.find("ekf").options(), 0, 8000)
    found = run_on(job, lambda: log, lambda: truth._replace(poses=poses))
    assert found.status == "done"
    assert "times what is stated" not in found.reason
    assert "stated standard deviations" not in found.reason
    assert (UNTURNED if case == "headings" else OTHER_WAYS) in found.reason
    assert "nees" not in found.row
    assert "ate_m" in found.row
    assert ("heading_rad" in found.row) == ("rpe_m" in found.row) == (case != "headings")


def test_a_log_with_a_mistake_blames_no_noise() -> None:
    log, truth = circle()
    turned = replace(log, z=log.z * [1, -1])
    job = Job("ekf", "ekf", registry.find("ekf").options(), 0, 8000)
    plain, known = (run_on(job, lambda: turned, lambda: truth, mistaken=mistaken) for mistaken in (False, True))
    assert "times what is stated" in plain.reason
    assert known.reason == MISTAKEN
    for name in ("ate_m", "nees", "cost_j"):
        assert known.row[name] == plain.row[name]
