"""Opens the inertial readings of a recording: imu.csv beside it, or topics of its bag."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Log
from ...core.se2 import Array
from ...frontend.inertial.against_wheels import against_wheels, in_odometry
from ...frontend.inertial.imu import SELDOM, Imu, spanned
from ...frontend.inertial.levels import Levels
from ...frontend.inertial.log import with_turns
from ...frontend.inertial.standing import Readings, Standing, standing
from ...frontend.inertial.words import about
from ...frontend.wheels.track import Poses
from ..bags.bag import Bag, is_bag
from ..bags.topics import plain
from ..bags.transforms import Transforms
from ..remarks import remarked
from ..robot_files import ROBOT
from .clipping import FORCES, RATES, clipped
from .imu_csv import IMU, Raw, read_imu_csv
from .imu_messages import IMU as MESSAGE
from .imu_messages import read_imu_messages
from .mounted import placed
from .robot import ImuTable
from .units import accelerations, fields, rates

BASES = ("base_link", "base_footprint")  # frames of the robot itself

CLOCK = "imu_late"  # how late its stamps are, and by whose turns, among a log's notes

NOTE = "imu"  # the readings in a sentence, among a log's notes

SLOW = 5.0  # s between readings: times in milliseconds


class OpenedImu(NamedTuple):
    """Inertial readings, and what the robot's standing still says about them."""

    imu: Imu
    stood: Standing
    twice: bool = False  # the odometry's turns are made of the same readings
    levels: Levels | None = None  # by gravity, where it levels what is seen


def open_imu(
    recording: Path,
    home: Path,
    table: ImuTable | None,
    odometry: Readings | None,
    notes: dict[str, Any],
    remarks: list[str],
    path_of: Callable[[], Poses] | None = None,
) -> OpenedImu | None:
    """The inertial readings of the `recording`, a bag or another, or of imu.csv in the folder `home`; None without any.

    `notes` and `remarks` grow. What cannot be used is an InputError where robot.toml has [imu], the `table`, else
    a remark. `path_of` gives the path by odometry that is none itself, to compare its turns with the gyro's.
    """
    try:
        imu, said = _read(recording, home, table or ImuTable())
    except InputError as error:
        if table is not None:
            raise
        notes[NOTE] = f"not used: {str(error).removesuffix('.')}"
        remarks.append(f"the inertial readings are {notes[NOTE]}")
        return None
    if imu is None:
        if table is not None:
            raise InputError(
                f"{recording}: has no inertial readings, expected {home / IMU} or, in a bag, messages of "
                f"{plain(MESSAGE)}, as {ROBOT} has [imu]."
            )
        return None
    path = odometry if path_of is None or isinstance(odometry, Poses) else path_of()
    return _judged(imu, odometry, path, notes, remarks, said=said)


def open_imu_csv(
    path: Path,
    table: ImuTable,
    odometry: Readings,
    notes: dict[str, Any],
    remarks: list[str],
    truth: Poses | None = None,
) -> OpenedImu:
    """The inertial readings of a CSV file, as those of `open_imu`; InputError for what cannot be used.

    The ground truth, if there is one, tells whether the gyro or the odometry is wrong where they disagree.
    """
    own = list[str]()
    raw = read_imu_csv(path, table.columns, own)
    imu = imu_of(str(path), raw, table, None, own)
    return _judged(imu, odometry, odometry, notes, remarks, said=_unit(raw, table, "gyro"), truth=truth)


def beside(log: Log, opened: OpenedImu | None, first: int = 0) -> Log:
    """The log with the gyro's turns between its steps from `first` on; itself without one, or where it has them."""
    if opened is None or opened.twice or not opened.imu.turns:
        return log
    turned = with_turns(log, *opened[:2], first, opened.levels)
    if turned.gyro is None:
        turned = remarked(
            turned, [f"{opened.imu.source}: no turn between two steps is known by the gyro{_apart(opened.imu, log)}"]
        )
    return turned


def _apart(imu: Imu, log: Log) -> str:
    """Says that no reading is of the log's time, and what moves it; empty where one is."""
    if imu.t[0] <= log.t[-1] and imu.t[-1] >= log.t[0]:
        return ""
    return (
        f", as the times do not overlap: its readings are of {spanned(imu.t)}, the log's steps of {spanned(log.t)}; "
        f"{imu.times_by} moves them"
    )


def _judged(
    imu: Imu,
    odometry: Readings | None,
    path: Readings | None,
    notes: dict[str, Any],
    remarks: list[str],
    *,
    said: str | None,
    truth: Poses | None = None,
) -> OpenedImu:
    """The readings, compared with the odometry and with its `path`, where these are poses; `said`: the gyro's unit."""
    if isinstance(path, Poses):
        imu = against_wheels(imu, path, said=said, truth=truth)
    if imu.delay is not None:
        notes[CLOCK] = {**imu.delay._asdict(), "by": imu.clock}
        if imu.late:
            notes[CLOCK]["off"] = imu.with_delay(imu.delay.seconds)
    stood = standing(imu, odometry)
    if stood.bias is None and odometry is not None:
        stood = standing(imu)  # wheels that never stand, or that are late
    notes[NOTE] = about(imu, stood)
    remarks += imu.remarks
    twice = isinstance(odometry, Poses) and in_odometry(imu, odometry)
    if twice:
        remarks.append(
            f"{imu.source}: the odometry's turns are made of this gyro's readings, from which they differ by less than "
            "its noise: its turns are not in the log, where they would count twice"
        )
    return OpenedImu(imu, stood, twice)


def _read(recording: Path, home: Path, table: ImuTable) -> tuple[Imu | None, str | None]:
    """The readings, and their gyro's unit, if it was said."""
    file, remarks = home / IMU, list[str]()
    bag = Bag(recording) if is_bag(recording) else None
    listed = [] if bag is None else bag.listed()
    topics = [one for one in listed if one.type == MESSAGE and one.messages]
    if file.exists() and topics:
        raise InputError(f"{recording}: has topic {topics[0].name} as well as {file}, expected one of them.")
    if file.exists():
        raw = read_imu_csv(file, table.columns, remarks)
        return imu_of(str(file), raw, table, None, remarks), _unit(raw, table, "gyro")
    if bag is None or not (topics or table.topic):
        return None, None
    found = read_imu_messages(bag, listed, table.topic, table.magnetometer_topic, remarks)
    if found is None:
        return None, None
    raw, topic = found
    transforms = Transforms(bag, listed)
    base = next((name for name in BASES if transforms.knows(name)), BASES[0])
    pose = transforms.fixed(base, raw.frame) if raw.frame else None
    imu = imu_of(f"{recording}: topic {topic}", raw, table, pose, remarks)
    return imu, _unit(raw, table, "gyro")


def imu_of(where: str, raw: Raw, table: ImuTable, by_tf: Array | None, remarks: list[str]) -> Imu:
    """The readings in SI units and in the robot's axes; `by_tf` (4, 4) is tf's pose of their frame on the robot.

    InputError for times that are in other units.
    """
    usual = float(np.median(np.diff(raw.t)))
    if usual > SLOW:
        raise InputError(
            f"{where}: the median time between readings is {usual:.4g} s, expected at most {SLOW:g}: perhaps it is in "
            "milliseconds; a header says so with t [ms]."
        )
    gyro = rates(where, raw.gyro, _unit(raw, table, "gyro"), remarks, table.says.gyro)
    accel, mag = raw.accel, raw.mag
    if accel is not None:
        accel = accelerations(
            where, accel, _unit(raw, table, "accelerometer"), remarks, _by(raw, table, "accelerometer")
        )
    if mag is not None and np.isnan(mag).all():
        mag = None
    if mag is not None:
        mag = fields(where, mag, _unit(raw, table, "magnetometer"), remarks, table.says.magnetometer)
    ends, shaken = clipped(gyro, RATES), None if accel is None else clipped(accel, FORCES)
    on = placed(where, accel, table.mounting, by_tf, raw.frame, remarks, table.says)
    imu = Imu(
        t=raw.t + table.time_offset,
        gyro=gyro @ on.turn.T,
        accel=None if accel is None else accel @ on.turn.T,
        mag=None if mag is None else mag @ on.turn.T,
        clipped=ends if ends.any() else None,
        shaken=None if shaken is None or not shaken.any() else shaken,
        arm=on.arm,
        mounting=on.words,
        placed=on.told,
        source=where,
        offset=table.time_offset,
        offset_by=table.says.offset,
        times_by=table.says.times,
        unit_by=_by(raw, table, "gyro"),
    )
    return replace(imu, remarks=[*remarks, *_odd(imu)])


def _unit(raw: Raw, table: ImuTable, sensor: str) -> str | None:
    """The unit by the header, else by robot.toml."""
    return raw.units.get(sensor) or getattr(table, sensor)


def _by(raw: Raw, table: ImuTable, sensor: Literal["gyro", "accelerometer"]) -> str:
    """Names what says the unit, or can."""
    return "the header" if raw.units.get(sensor) else getattr(table.says, sensor)


def _odd(imu: Imu) -> Sequence[str]:
    """Says what is odd in the times and ranges of readings."""
    said = list[str]()
    if imu.seldom:
        said.append(
            f"{imu.source}: comes at {imu.rate:.3g} Hz (median), expected at least {SELDOM:g}: turns between readings "
            "are interpolated, and stated as wide as the rate's changes"
        )
    gaps = imu.gaps
    if len(gaps):
        begin, end = gaps[int(np.diff(gaps, axis=1).argmax())].tolist()
        several = f"{len(gaps)} times, the longest " if len(gaps) > 1 else ""
        said.append(
            f"{imu.source}: no reading {several}for {end - begin:.3g} s, from {begin:.10g} to {end:.10g} s, where "
            f"{imu.usual:.3g} s are usual (median): the turn meanwhile is not known by the gyro"
        )
    for name, mask, values, unit, lost in (
        ("gyro", imu.clipped, imu.gyro, "rad/s", "turns then are not known by the gyro"),
        ("accelerometer", imu.shaken, imu.accel, "m/s^2", "these readings say nothing about levels"),
    ):
        if mask is not None and values is not None:
            most = float(np.abs(values[mask]).max())
            said.append(
                f"{imu.source}: {int(mask.sum())} readings of the {name} are at the end of its range ({most:.4g} "
                f"{unit}), the first at {imu.t[mask][0]:.10g} s: {lost}"
            )
    return said
