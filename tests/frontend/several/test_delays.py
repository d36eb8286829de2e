"""Delays of a sensor by the turns that it and the gyro, or the wheels, tell."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from several_drives import driven, true_poses
from slamduel.core.se2 import wrap
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.laser.log import log_of
from slamduel.frontend.laser.recording import matched
from slamduel.frontend.several.delays import Turned, delay, remark, turned, turning
from slamduel.frontend.several.log import Scanned, joined
from slamduel.frontend.several.scan_motions import scan_motions
from slamduel.frontend.several.wheels_path import walked
from slamduel.frontend.wheels.motion import Drift
from tiers import first_quick

SEEDS = range(8)


def gyro(seed: int, end: float) -> Imu:
    """A gyro at 100 Hz with a bias of 0.01 rad/s and noise of 0.003 rad/s."""
    t = np.arange(0, end, 0.01)
    heading = np.unwrap(true_poses(t)[:, 2])
    rng = np.random.default_rng(seed)
    rate = np.gradient(heading, t) + 0.01 + 0.003 * rng.standard_normal(len(t))
    return Imu(t, np.column_stack((np.zeros((len(t), 2)), rate)))


@cache
def scanned(seed: int, late: float) -> tuple[Scanned, Turned]:
    """The scans of a drive, stamped `late` s later than they were taken."""
    made = driven(seed)
    scans = made.several.scans
    assert scans is not None
    motion = made.several.frames.motion
    t = scans.t + late
    kept = t <= motion.t[-1]
    scans = replace(scans.taken(kept), t=t[kept], odometry=walked(motion, t[kept]))
    front_end = matched(scans, made.several.settings)
    alone, motions = log_of(scans, front_end), scan_motions(front_end)
    found = turned(alone.t, motions.at, motions.to, motions.delta[:, 2], motions.cov[:, 2, 2])
    return Scanned(scans, alone, front_end, motions), found


@pytest.mark.parametrize("seed", first_quick(SEEDS, 1))
@pytest.mark.parametrize("late", [0.0, 0.05])
def test_a_scanner_that_is_late_is_found_by_the_gyro(seed: int, late: float) -> None:
    _, seen = scanned(seed, late)
    known = turning(driven(seed).several.frames.motion, gyro(seed, 31.0))
    assert known is not None
    assert known.by == "gyro"
    found = delay(known, seen)
    assert found is not None
    assert found.sd < 0.01
    assert abs(found.seconds - late) < 4 * found.sd
    assert found.odd == (late > 0)


@pytest.mark.parametrize("seeds", first_quick([range(1), range(1, 3)]))
def test_wheels_tell_less(seeds: range) -> None:
    off = list[float]()
    for seed in seeds:
        known = turning(driven(seed).several.frames.motion, None)
        assert known is not None
        found = delay(known, scanned(seed, 0.0)[1])
        if found is not None:
            off.append(found.seconds / found.sd)
    assert off
    assert max(map(abs, off)) < 4


def test_the_log_has_the_delay_and_a_remark() -> None:
    made = driven(0)
    late, _ = scanned(0, 0.05)
    log = joined(made.several._replace(imu=gyro(0, 31.0)), made.seen, late).log
    assert abs(log.notes["laser"]["late"]["seconds"] - 0.05) < 0.02
    assert "by the turns of the gyro the stamps of the laser are" in log.remarks[-1]
    assert "[laser] time_offset = -0.0" in log.remarks[-1]


def test_turns_have_no_stretch_of_the_way_in_common() -> None:
    at, to = np.array([1, 2, 3, 5, 6]), np.array([0, 0, 0, 3, 4])
    found = turned(np.arange(7.0), at, to, np.array([0.1, 0.3, 0.6, 1.0, 9.0]), np.full(5, 0.01))
    np.testing.assert_array_equal(found.start, [0, 1, 2, 3])
    np.testing.assert_array_equal(found.end, [1, 2, 3, 5])
    np.testing.assert_allclose(found.turn, [0.1, 0.2, 0.3, 1.0])
    np.testing.assert_allclose(found.var, [0.01, 0.02, 0.02, 0.01])


def test_nothing_is_told_without_turns_or_where_they_are_even() -> None:
    assert turning(Drift(1.0, 1.0), None) is None
    known = turning(Drift(1.0, 1.0), gyro(0, 30.0))
    assert known is not None
    ends = np.arange(2.0, 28.0)
    assert delay(known, Turned(ends[:3], ends[:3] + 1, np.zeros(3), np.full(3, 1e-6))) is None
    even = known._replace(heading=0.5 * known.t)
    assert delay(even, Turned(ends[:-1], ends[1:], np.full(25, 0.5), np.full(25, 1e-6))) is None


@pytest.mark.parametrize("seed", first_quick(SEEDS))
def test_delays_of_simulated_turns_are_as_sure_as_stated(seed: int) -> None:
    rng, sd = np.random.default_rng(seed), 2e-3
    known = turning(Drift(1.0, 1.0), gyro(seed, 60.0))
    assert known is not None
    off = list[float]()
    for _ in range(20):
        late, ends = rng.uniform(-0.3, 0.3), np.arange(2.0, 57.0, 0.7)
        heading = np.unwrap(true_poses(ends - late)[:, 2])
        turn = wrap(np.diff(heading) + sd * rng.standard_normal(len(ends) - 1))
        found = delay(known, Turned(ends[:-1], ends[1:], turn, np.full(len(turn), sd**2)))
        assert found is not None
        off.append((found.seconds - late) / found.sd)
        assert f"{1e3 * abs(found.seconds):.0f} ±" in remark("x", "laser", "gyro", found)
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.8
