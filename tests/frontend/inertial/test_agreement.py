"""Delays, factors and other drives are found in a gyro's turns, on eight seeds each, and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from inertial_drives import Drive, drive
from slamduel.bench.plan.load import load
from slamduel.core.factors import Log
from slamduel.core.se2 import Array, summed
from slamduel.frontend.inertial.against_wheels import against_wheels
from slamduel.frontend.inertial.agreement import Agreement, agreement
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.wheels.track import Poses
from tiers import first_quick

SEEDS = range(8)
BIAS = np.deg2rad(1.0)  # rad/s
STRETCH, SPINS, TRACK = 0.5, 0.2, 0.5  # m, of which a wheel slips or not, share it then reads more or less, m between


def flat(seed: int, seconds: float = 120.0) -> Drive:
    return drive(seed, seconds, 50.0, hills=0.0)


def gyro(one: Drive, late: float = 0.0, factor: float = 1.0) -> Imu:
    """Readings with a bias of 1 degree/s, stamped late."""
    return replace(one.imu, t=one.t + late, gyro=factor * one.imu.gyro + np.array([0.0, 0.0, BIAS]))


def wheels(one: Drive, seed: int, slip: float = 0.0, every: int = 5) -> Poses:
    """Odometry at 10 Hz with noise along the way, of wheels that slip on the share `slip` of it."""
    rng = np.random.default_rng([seed, 7])
    t, heading = one.t[::every], one.heading[::every]
    way = np.diff(np.cumsum(one.speed)[::every]) / 50.0
    stretch = np.floor(np.cumsum(way) / STRETCH).astype(int)
    slips = (rng.random(stretch[-1] + 1) < slip) * rng.choice([-1.0, 1.0], stretch[-1] + 1)
    turn = np.diff(heading) + 0.03 * np.sqrt(way) * rng.standard_normal(len(way))
    turn += SPINS / TRACK * slips[stretch] * way
    return Poses(t, summed(np.zeros(3), np.column_stack((way, 0 * way, turn))))


def found(imu: Imu, path: Poses) -> Agreement:
    said = agreement(imu, path)
    assert said is not None
    return said


def exact(one: Drive) -> Poses:
    return one.odometry


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("late", [0.1, 0.5, 2.0, -0.5, -2.0])
def test_a_planted_delay_is_found(late: float, seed: int) -> None:
    one = flat(seed)
    said = found(gyro(one, late), wheels(one, seed))
    assert said.late
    assert said.delay is not None
    assert said.delay.seconds == pytest.approx(late, abs=0.03)
    assert abs(said.delay.seconds - late) < 4 * max(said.delay.sd, 0.003)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("slip", [0.0, 0.1, 0.2])
def test_wheels_that_slip_are_no_fault_of_the_gyro(slip: float, seed: int) -> None:
    one = flat(seed)
    imu = gyro(one)
    assert against_wheels(imu, wheels(one, seed, slip), said=None).remarks == imu.remarks


@pytest.mark.parametrize("seed", SEEDS)
def test_a_delay_is_found_beside_wheels_that_slip(seed: int) -> None:
    one = flat(seed)
    said = found(gyro(one, 2.0), wheels(one, seed, 0.2))
    assert said.late
    assert said.delay is not None
    assert said.delay.seconds == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("factor", [-1.0, 2.0, 0.5, 20.0])
def test_another_sign_or_unit_takes_the_turns_out_of_the_log(factor: float, seed: int) -> None:
    one = flat(seed)
    said = against_wheels(gyro(one, factor=factor), wheels(one, seed), said="rad/s")
    (remark,) = said.remarks
    assert "rad for each that the odometry turns, expected 1" in remark
    assert remark.endswith("; its turns are not in the log")
    assert (said.turns, said.late) == (False, False)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_gyro_of_another_drive_is_told_from_a_delay(seed: int) -> None:
    one, other = flat(seed), flat(seed + 100)
    said = against_wheels(gyro(other), wheels(one, seed), said=None)
    (remark,) = said.remarks
    assert "the gyro does not turn as the odometry does, at no delay of up to 5 s" in remark
    assert (said.turns, said.late) == (False, False)


@pytest.mark.parametrize("seed", SEEDS)
def test_of_three_clocks_the_one_that_disagrees_with_two_is_late(seed: int) -> None:
    one = flat(seed)
    odometry = wheels(one, seed)
    said = against_wheels(gyro(one, 1.0), odometry, said=None, truth=exact(one))
    (remark,) = said.remarks
    assert "by the turns of the ground truth the gyro is " in remark
    assert said.delay is not None
    assert said.delay.seconds == pytest.approx(1.0, abs=0.01)
    assert "which the odometry's turns say, too; its turns are not in the log" in remark
    assert not said.turns
    late = odometry._replace(t=odometry.t + 1.0)
    said = against_wheels(gyro(one), late, said=None, truth=exact(one))
    (remark,) = said.remarks
    assert remark.endswith("the odometry is wrong, and the gyro's turns are in the log")
    assert (said.turns, said.doubt, said.late) == (True, "", False)
    other = exact(flat(seed + 100))
    said = against_wheels(gyro(one), odometry, said=None, truth=other)
    assert (said.turns, said.remarks) == (True, gyro(one).remarks)


@pytest.mark.parametrize("seed", SEEDS)
def test_degrees_that_are_late_are_converted_and_late(seed: int) -> None:
    one = flat(seed)
    said = against_wheels(gyro(one, 0.5, 180 / np.pi), wheels(one, seed), said=None)
    converted, late = said.remarks
    assert "taken to be in degrees/s, and converted" in converted
    assert "by the turns of the odometry the gyro is" in late
    assert said.delay is not None
    assert said.delay.seconds == pytest.approx(0.5, abs=0.03)
    assert (said.turns, said.late) == (False, True)


@pytest.mark.parametrize("seed", SEEDS)
def test_of_a_robot_that_hardly_turns_nothing_is_said(seed: int) -> None:
    one = flat(seed)
    straight = one._replace(heading=0.02 * one.heading, imu=replace(one.imu, gyro=0.02 * one.imu.gyro))
    other = flat(seed + 100)
    noise = np.random.default_rng(seed).normal(0, 0.004, one.imu.gyro.shape)
    for turning in (straight.imu.gyro, 0.02 * other.imu.gyro):
        imu = replace(one.imu, gyro=turning + noise)
        for slip in (0.0, 0.2):
            assert against_wheels(imu, wheels(straight, seed, slip), said=None).remarks == imu.remarks


def test_a_gap_of_the_readings_does_not_count() -> None:
    one = flat(3)
    imu = gyro(one, 0.5)
    kept = (imu.t < 40) | (imu.t > 55)
    said = found(replace(imu, t=imu.t[kept], gyro=imu.gyro[kept]), wheels(one, 3))
    assert said.delay is not None
    assert said.delay.seconds == pytest.approx(0.5, abs=0.03)


def test_too_short_a_drive_tells_nothing() -> None:
    one = flat(0, 8.0)
    assert agreement(gyro(one, 1.0), wheels(one, 0)) is None
    still = replace(one.imu, gyro=0 * one.imu.gyro)
    assert agreement(still, wheels(one, 0)) is None
    long = flat(0)
    assert found(replace(long.imu, gyro=0 * long.imu.gyro), wheels(long, 0)).slope is None
    early = replace(one.imu, t=one.t - 900.0)
    assert agreement(early, wheels(one, 0)) is None


def of_log(log: Log) -> tuple[Imu, Poses]:
    """The turns of a world's gyro as readings at 50 Hz, and its odometry as a path."""
    assert log.gyro is not None
    rate = np.zeros(len(log))
    rate[log.gyro.step] = log.gyro.turn / log.gyro.dt
    t = np.arange(log.t[0], log.t[-1], 0.02)
    each: Array = rate[np.clip(np.searchsorted(log.t, t, "right"), 0, len(log) - 1)]
    rates = np.column_stack((0 * each, 0 * each, each))
    return Imu(t, rates), Poses(log.t, summed(log.prior.pose, log.delta[1:]))


@pytest.mark.parametrize(
    ("world", "seed"), first_quick([(w, s) for w in ("aruco-room", "circle", "laser-floor") for s in SEEDS])
)
@pytest.mark.parametrize("slip", [0.0, 0.2])
def test_no_simulated_world_has_a_false_remark(world: str, seed: int, slip: float) -> None:
    log, _ = load(f"{world}[gyro=0.01,gyro_bias=1,slip_share={slip}]", seed)
    imu, path = of_log(log)
    assert against_wheels(imu, path, said=None).remarks == imu.remarks
