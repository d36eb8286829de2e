"""The made-up floor by a robot that rocks: beams in space, and scans levelled by its accelerometer."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from in_space import beams_in_space
from refusals import refused
from slamduel.bench.plan.load import load
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.on_demand.rocking import Rocking
from slamduel.datasets.worlds.floor_plan import floor_plan
from slamduel.datasets.worlds.laser_floor import DEPTH, FURTHEST, NO_RETURN, PUSH, RESOLUTION, SIZE, Options, record
from slamduel.frontend.inertial.tilts import LEVELS
from slamduel.frontend.laser.log import log_of
from slamduel.frontend.laser.recording import matched
from tiers import first_quick

ROCKING = Options(laps=0.1, people=0, sway=0.04)


def ends(walls: Array, height: float, at: Array, beam: Array) -> float:
    """The range of a beam (3,) from `at` (2,), m, at `height`: of the nearest of upright walls (w, 4) and the floor."""
    found = [np.inf] if beam[2] >= 0 else [height / -beam[2]]
    for x0, y0, x1, y1 in walls:
        along = np.array([x1 - x0, y1 - y0])
        system = np.column_stack((beam[:2], -along))
        if abs(np.linalg.det(system)) > 1e-12:
            reach, share = np.linalg.solve(system, np.array([x0, y0]) - at)
            if reach > 0 and 0 <= share <= 1:
                found.append(float(reach))
    return min(found)


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_beams_end_at_walls_and_floor_in_space(seed: int) -> None:
    options = replace(ROCKING, beams=31, range_sd=0.0, scanner_height=0.25)
    recording, truth = record(options, np.random.default_rng(seed))
    building, *_, felt = np.random.default_rng(seed).spawn(5)
    plan = floor_plan(*SIZE, DEPTH, building)
    leans = Rocking.drawn(options.sway, felt.spawn(2)[0]).at(truth.t)
    returned = of_floor = 0
    for k in range(3, len(truth.t), 9):
        x, y, heading = truth.poses[k]
        c, s = np.cos(heading), np.sin(heading)
        body = beams_in_space(recording.scanner.angles, *leans[k])
        for beam, measured in zip(body, recording.ranges[k].tolist(), strict=True):
            turned = np.array([c * beam[0] - s * beam[1], s * beam[0] + c * beam[1], beam[2]])
            expected = ends(plan.walls, options.scanner_height, np.array([x, y]), turned)
            if measured == NO_RETURN:
                continue
            returned += 1
            of_floor += expected == options.scanner_height / -beam[2]
            assert measured < FURTHEST
            assert measured == pytest.approx(expected, abs=RESOLUTION / 2 + 1e-6)
    assert returned > 100
    assert of_floor > 5


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_scans_are_levelled_on_the_same_drive(seed: int) -> None:
    plain, truth = record(ROCKING, generator("laser-floor", seed))
    level, same = record(replace(ROCKING, imu=True), generator("laser-floor", seed))
    np.testing.assert_array_equal(truth.poses, same.poses)
    assert plain.odometry is not None
    np.testing.assert_array_equal(plain.odometry, level.odometry)
    assert LEVELS not in plain.notes
    told = level.notes[LEVELS]
    assert told["of"] == "scans"
    assert 0.05 < told["sd"] < 2.0
    lost = np.isnan(level.ranges)
    assert 0.005 < lost.mean() < 0.2
    assert (level.ranges[~lost] <= plain.ranges[~lost]).all()
    steep, there = record(replace(ROCKING, imu=True, max_tilt=0.05), generator("laser-floor", seed))
    assert 0.3 * len(plain.t) < len(steep.t) < 0.95 * len(plain.t)
    np.testing.assert_array_equal(there.poses, truth.poses[np.isin(truth.t, steep.t)])


def test_a_robot_that_rocks_has_inertia_and_meets_no_wall() -> None:
    recording, truth = record(replace(ROCKING, laps=1.0, range_sd=0.0), generator("laser-floor", 2))
    assert recording.ranges.min() > 0.2
    way = np.hypot(*between(truth.poses[:-1], truth.poses[1:])[:, :2].T) / np.diff(truth.t)
    assert np.abs(np.diff(way) / np.diff(truth.t)[1:]).max() < 1.1 * PUSH


@pytest.mark.parametrize(("seeds", "laps"), first_quick([((3,), 0.3), (tuple(range(8)), 1.0)]))
def test_motions_are_closer_levelled(seeds: Sequence[int], laps: float) -> None:
    """Fewer scans match nothing, and errors are as large as stated."""
    lost, squares, off = np.zeros((2, len(seeds))), np.zeros((2, len(seeds))), np.zeros((2, len(seeds)))
    for j, seed in enumerate(seeds):
        for i, imu in enumerate((False, True)):
            options = Options(laps=laps, sway=0.04, imu=imu)
            recording, truth = record(options, generator("laser-floor", seed))
            front_end = matched(recording, options)
            log = log_of(recording, front_end)
            true = truth.poses[np.searchsorted(truth.t, log.t)]
            error = log.delta[1:] - between(true[:-1], true[1:])
            error[:, 2] = wrap(error[:, 2])
            lost[i, j] = front_end.tracker.lost
            squares[i, j] = np.einsum("ni,nij,nj->n", error, np.linalg.inv(log.delta_cov[1:]), error).mean() / 3
            off[i, j] = np.sqrt((error[:, :2] ** 2).sum(axis=1).mean())
    assert lost[1].sum() < 0.2 * lost[0].sum()
    assert np.log(off[1] / off[0]).mean() < np.log(0.9)
    assert squares[1].mean() < 2.0


def test_the_log_says_how_it_was_levelled() -> None:
    log, truth = load("laser-floor[laps=0.15,sway=0.03,imu=true,max_tilt=0.05,gyro=0.05]", seed=3)
    assert log.notes[LEVELS]["push"] > 0
    said = " ".join(log.remarks)
    assert "the robot leans by more than max_tilt, 0.05 rad, at" in said
    assert "% of the returns are of the floor" in said
    assert log.gyro is not None
    assert truth is not None
    np.testing.assert_array_equal(truth.t, log.t)


@pytest.mark.parametrize("alone", ["imu=true", "scanner_height=0.2", "sway=0.03,max_tilt=0.1"])
def test_options_without_the_one_they_belong_to_are_refused(alone: str) -> None:
    refused("has no effect without", load, f"laser-floor[{alone}]", 0)
