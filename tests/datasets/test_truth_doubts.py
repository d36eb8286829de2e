"""A truth that cannot be the log's, odometry that stands, and logs on which neither is so."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Truth
from slamduel.core.se2 import Array, summed, wrap
from slamduel.core.truth.doubts import headings_known, judges, ways
from slamduel.datasets.published.tum_pioneer import PARTIAL_NOTE
from slamduel.datasets.remarks import remarks
from slamduel.datasets.truth import POSES, with_truth

WORLDS = ("circle", "bailey", "aruco-robot", "matlab-report", "laser-floor", "linear", "linear[turning=0.1]")
SIGHTED = WORLDS[:4]


def made(name: str) -> tuple[Log, Truth]:
    log, truth = load(name)
    assert truth is not None
    return log, truth


def scaled(truth: Truth, factor: float) -> Truth:
    return truth._replace(poses=truth.poses * [factor, factor, 1.0])


def turned_to(truth: Truth, heading: float) -> Truth:
    return truth._replace(poses=np.column_stack((truth.poses[:, :2], np.full(len(truth.t), heading))))


def part(truth: Truth, rows: Any) -> Truth:
    return truth._replace(t=truth.t[rows], poses=truth.poses[rows])


def driven(log: Log, delta: Array) -> Log:
    return replace(log, delta=np.where(np.isnan(log.delta), log.delta, delta))


@pytest.mark.parametrize("name", SIGHTED)
@pytest.mark.parametrize("change", ["pose constant", "speed 0", "jitter"])
def test_odometry_that_stands_while_ranges_change_is_remarked(name: str, change: str) -> None:
    log, _ = made(name)
    noise = np.random.default_rng(1).normal(0, [1e-3, 1e-3, 1e-4], log.delta.shape)
    delta = {"pose constant": 0 * log.delta, "speed 0": log.delta * [0, 0, 1], "jitter": noise}[change]
    (told,) = remarks(Dataset(driven(log, delta), None))
    assert told.startswith("the odometry stays within " if change == "jitter" else "the odometry never moves, but ")
    assert "its range changes by" in told


@pytest.mark.parametrize("name", SIGHTED)
def test_odometry_that_repeats_a_place_while_ranges_change_is_remarked(name: str) -> None:
    log, _ = made(name)
    half = np.arange(len(log)) < len(log) // 2
    told = remarks(Dataset(driven(log, log.delta * half[:, None]), None))
    assert [one for one in told if one.startswith("the odometry repeats a place for up to ")]


def among_landmarks(log: Log, delta: Array, rng: np.random.Generator, stated: float, wrong: float) -> Log:
    """A log by the motions `delta`, with noise over that which is `stated`, and a share of `wrong` ids."""
    path = summed(np.zeros(3), delta[1:])
    places = np.column_stack((rng.uniform(-4, path[:, 0].max() + 4, 40), rng.uniform(-6, 6, 40)))
    off = places[None] - path[:, None, :2]
    r = np.hypot(*off.transpose(2, 0, 1))
    step, ids = np.nonzero((r > 0.5) & (r < 8))
    bearing = np.arctan2(off[step, ids, 1], off[step, ids, 0]) - path[step, 2]
    sd = np.array([0.05, 0.02])
    z = np.stack((r[step, ids], bearing), axis=-1) + rng.standard_normal((len(step), 2)) * sd / stated
    z = np.stack((np.abs(z[:, 0]) + 0.01, wrap(z[:, 1])), axis=-1)
    ids = np.where(rng.uniform(size=len(ids)) < wrong, rng.integers(0, 40, len(ids)), ids)
    cov = np.tile(np.diag(sd**2), (len(z), 1, 1))
    return Log.from_arrays("among", log.prior, log.t, delta, log.delta_cov, step, ids, z, cov)


def test_odometry_that_never_turns_while_bearings_do_is_remarked() -> None:
    log, _ = made("circle")
    turns = among_landmarks(log, np.tile([0.1, 0.0, 0.2], (len(log), 1)), np.random.default_rng(4), 1.0, 0.0)
    assert not [one for one in remarks(Dataset(turns, None)) if "odometry" in one]
    told = remarks(Dataset(driven(turns, turns.delta * [1, 1, 0]), None))
    assert [one for one in told if one.startswith("the odometry never turns, but between two")]


@pytest.mark.parametrize("wrong", [0.0, 0.2])
@pytest.mark.parametrize("stated", [1.0, 0.1])
def test_a_robot_that_goes_straight_is_not_remarked_whatever_its_noise_and_ids(stated: float, wrong: float) -> None:
    """It goes by landmarks on both sides, and stops at times."""
    log, _ = made("circle")
    delta = np.where((np.arange(len(log)) % 100 < 80)[:, None], [0.2, 0.0, 0.0], 0.0)
    straight = among_landmarks(log, delta, np.random.default_rng(4), stated, wrong)
    assert not [one for one in remarks(Dataset(straight, None)) if "odometry" in one]


@pytest.mark.parametrize("name", SIGHTED)
@pytest.mark.parametrize("stated", [1.0, 0.1])
@pytest.mark.parametrize("slip", [0.0, 1e-3])
def test_a_robot_that_really_stands_is_not_remarked_whatever_its_noise(name: str, stated: float, slip: float) -> None:
    """A tenth of the ranges is anything at all, and ten times too little noise may be stated; its GPS wanders."""
    log, truth = made(name)
    rng = np.random.default_rng(2)
    ids, first = np.unique(log.ids, return_index=True)
    z = log.z[first][np.searchsorted(ids, log.ids)]
    z = z + rng.standard_normal(z.shape) * np.sqrt(np.einsum("kii->ki", log.z_cov)) / stated
    odd = rng.uniform(size=len(z)) < 0.1
    z[:, 0] = np.where(odd, rng.uniform(0.5, 8, len(z)), np.abs(z[:, 0]) + 0.01)
    stands = replace(driven(log, rng.normal(0, slip, log.delta.shape) if slip else 0 * log.delta), z=z)
    gps = np.cumsum(rng.normal(0, 0.1, truth.poses.shape), axis=0)
    for known in (None, truth._replace(poses=np.tile(truth.poses[:1], (len(log), 1))), truth._replace(poses=gps)):
        assert not [one for one in remarks(Dataset(stands, known)) if "odometry" in one and "never" in one]
        assert not [one for one in remarks(Dataset(stands, known)) if "the odometry stays" in one]


@pytest.mark.parametrize("name", WORLDS)
def test_a_truth_as_it_comes_is_the_logs(name: str) -> None:
    log, truth = made(name)
    for rows in (slice(None), slice(None, None, 10), slice(0, len(log) // 3), slice(5, 9)):
        some = part(truth, rows)
        assert headings_known(log, some)
        found = ways(log, some)
        assert found is None or not found.apart
        assert judges(log, some) == truth.exact


@pytest.mark.parametrize("name", WORLDS[:5])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_headings_that_never_turn_are_not_known(name: str, heading: float) -> None:
    log, truth = made(name)
    for rows in (slice(None), slice(None, None, 5)):
        some = turned_to(part(truth, rows), heading)
        assert not headings_known(log, some)
        assert not judges(log, some)
        assert any(f"the truth's heading is always {heading:.3g} rad" in one for one in remarks(Dataset(log, some)))


OTHERS: dict[str, Callable[[Array], Array]] = {
    "clockwise": lambda headings: -headings,
    "from north, clockwise": lambda headings: np.pi / 2 - headings,
    "turned": lambda headings: headings - np.pi / 2,
    "backwards": lambda headings: headings + np.pi,
}


@pytest.mark.parametrize("name", WORLDS[:5])
@pytest.mark.parametrize("case", OTHERS)
def test_headings_of_another_frame_are_not_known(name: str, case: str) -> None:
    """Nor where drift of the odometry's heading adds a twentieth of a turn along the log."""
    log, truth = made(name)
    poses = truth.poses.copy()
    poses[:, 2] = wrap(OTHERS[case](poses[:, 2]))
    wrong = truth._replace(poses=poses)
    half = np.arange(len(log))[:, None] > len(log) / 2
    drifted = driven(log, log.delta + np.array([0.0, 0.0, 0.3 / len(log)]))
    for one in (log, drifted):
        assert headings_known(one, truth)
        assert not headings_known(one, wrong)
    assert headings_known(driven(log, np.where(half, 0.0, log.delta)), truth)
    assert any("the truth's headings turn otherwise, or" in one for one in remarks(Dataset(log, wrong)))


def test_a_robot_that_slides_at_one_heading_has_a_known_one() -> None:
    for name in WORLDS[5:]:
        log, truth = made(name)
        assert headings_known(log, turned_to(truth, 0.0))


FACTORS = [
    (1000.0, "the truth is in millimetres, or the odometry in kilometres"),
    (0.001, "the odometry is in millimetres, or the truth in kilometres"),
    (100.0, "the truth is in centimetres"),
    (1 / 39.37, "the odometry is in inches"),
    (3.281, "the truth is in feet"),
    (0.3048, "the odometry is in feet"),
    (3.6, "the odometry's speeds were taken for km/h"),
    (1 / 3.6, "the odometry's speeds are in km/h"),
    (2.0, "the odometry takes a wheel's radius for its diameter"),
    (1.7, "a clock, a speed or the size of the wheels is wrong"),
]


@pytest.mark.parametrize("name", [*WORLDS, "city"])
def test_ways_that_differ_as_by_a_unit_name_it(name: str) -> None:
    log, truth = made(name)
    for factor, words in FACTORS:
        if min(factor, 1.0) * np.ptp(truth.poses[:, :2]) < 0.1:
            continue  # it hardly moves
        for rows in (slice(None), slice(None, None, 7)):
            some = scaled(part(truth, rows), factor)
            told = [one for one in remarks(Dataset(log, some)) if "truth" in one and "perhaps" in one]
            assert any(words in one or "stays within" in one for one in told), (factor, told)
            assert not judges(log, some)


@pytest.mark.parametrize("factor", [0.75, 0.9, 1.1, 1.35])
def test_wheels_of_another_size_are_no_other_unit(factor: float) -> None:
    for name in WORLDS:
        log, truth = made(name)
        assert not any("times as far" in one for one in remarks(Dataset(log, scaled(truth, factor))))


def test_a_truth_that_stands_while_the_odometry_goes_is_remarked() -> None:
    log, truth = made("circle")
    (told,) = remarks(Dataset(log, truth._replace(poses=np.tile(truth.poses[:1], (len(log), 1)))))
    assert told.startswith("the truth stays within 0 m, where the odometry is of ")


@pytest.mark.parametrize(("share", "told"), [(0.06, 1), (0.59, 1), (0.8, 0), (1.0, 0)])
def test_a_truth_of_a_part_of_the_log_is_remarked(share: float, told: int) -> None:
    log, truth = made("circle[steps=200]")
    n = round(share * len(log))
    for rows in (slice(0, n), np.linspace(0, len(log) - 1, n).round().astype(int)):
        found = remarks(Dataset(log, part(truth, rows)))
        assert [one.startswith(f"the truth is known at {n} of {len(log)} steps, ") for one in found] == [True] * told
        assert remarks(Dataset(log, part(truth, rows)._replace(words="GPS"))) == []
        noted = replace(log, notes={**log.notes, PARTIAL_NOTE: "of a part"})
        assert remarks(Dataset(noted, part(truth, rows))) == []


def test_a_truth_in_nanoseconds_names_its_clock() -> None:
    log, truth = made("circle[steps=200]")
    of_log, odd = remarks(with_truth(log, truth._replace(t=truth.t * 1e9)))
    assert re.match(rf"the times of {POSES} go on for \S+ s, those of the log for \S+ s: perhaps they are in ", of_log)
    assert odd.startswith(f"the truth is known at 1 of {len(log)} steps")


def test_known_landmarks_that_are_never_sighted_are_remarked() -> None:
    log, truth = made("circle")
    assert truth.map is not None
    other = truth._replace(map=truth.map._replace(ids=truth.map.ids + 1000), assigned=None)
    (told,) = remarks(Dataset(log, other))
    assert told.startswith(
        f"none of the {len(other.map.ids)} landmarks with a known place (landmarks.csv), of ids from "
    )
    one = truth.map.ids.copy() + 1000
    one[0] = log.ids[0]
    (told,) = remarks(Dataset(log, truth._replace(map=truth.map._replace(ids=one), assigned=None)))
    assert told.startswith("19 of the 20 ids that are sighted have no known place (landmarks.csv), ")
    unknown = replace(log, ids=np.full_like(log.ids, -1))
    assert not any("known place" in said for said in remarks(Dataset(unknown, other)))


def test_a_folder_says_so_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from slamduel.bench.cli import main
    from slamduel.datasets.formats import log_folder

    log, truth = made("circle[steps=200]")
    log_folder.write(tmp_path / "log", log, scaled(truth, 1000.0))
    assert main(["validate", "--strict", str(tmp_path / "log")]) == 2
    assert "perhaps the truth is in millimetres" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("off", "sd", "told"),
    [
        ([0.0, 0.0, 0.0], 1e-3, 0),
        ([0.5, -0.5, 0.3], 1e-3, 0),  # measured by hand
        ([1.65e3, 0.0, 0.0], 1e-3, 1),
        ([0.0, 0.0, 1.5], 1e-3, 1),
        ([0.0, 0.0, 2 * np.pi], 1e-3, 0),
        ([50.0, 20.0, 1.0], 20.0, 0),
    ],
)
def test_a_given_start_that_is_not_the_truths_is_remarked(off: list[float], sd: float, told: int) -> None:
    log, truth = made("circle")
    moved = replace(log, prior=log.prior._replace(pose=log.prior.pose + off, cov=np.diag([sd, sd, min(sd, 0.9)]) ** 2))
    found = [one for one in remarks(Dataset(moved, truth)) if one.startswith("the log starts ")]
    assert len(found) == told
    later = remarks(Dataset(moved, part(truth, slice(20, None))))  # by then its odometry has drifted
    assert not [one for one in later if one.startswith("the log starts ")]
