"""Opens what a recording tells of the robot's place in the world: gps.csv or NavSatFix, and a magnetometer's headings.

Both are used where robot.toml has [gps] or [compass]: indoors a receiver and a compass tell little, and an axis along
north has to be meant.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError
from ...core.factors import Log
from ...core.se2 import act
from ...frontend.inertial.imu import Imu
from ...frontend.inertial.levels import Levels
from ...frontend.wheels.motion import Drift, Motion
from ...frontend.world.compass import directions
from ...frontend.world.fixes import path_at, ways, with_fixes
from ...frontend.world.jumps import elsewhere, swapped, without_jumps
from ...frontend.world.measured import Measured, joined
from ...frontend.world.start import start
from ..bags.bag import Bag, is_bag
from ..bags.topics import plain
from ..remarks import remarked
from ..robot_files import ROBOT
from .degrees import measured
from .gps_csv import FILE, read_gps_csv
from .gps_messages import NAVSAT, read_gps_messages
from .robot import WorldTables


class OpenedWorld(NamedTuple):
    """Positions, headings or both."""

    found: Measured
    source: str  # of the positions, in remarks
    offset_sd: float  # rad, of a constant error of the headings
    motion: Motion | None  # by the wheels; None: the log's odometry alone tells it
    start_given: bool  # by [prior] in robot.toml, with x east and y north

    def only(self, sensors: Sequence[str]) -> "OpenedWorld | None":
        """Those of gps, of compass, or of both, as named; None for none."""
        kept = ("gps" in sensors) & self.found.placed | ("compass" in sensors) & ~self.found.placed
        return self._replace(found=self.found.taken(kept)) if kept.any() else None


def open_world(
    recording: Path,
    home: Path,
    tables: WorldTables,
    imu: Imu | None,
    motion: Motion | None,
    notes: dict[str, Any],
    remarks: list[str],
    levels: Levels | None = None,
    *,
    start_given: bool,
) -> OpenedWorld | None:
    """The positions of the `recording`, a bag or another, or of gps.csv in the folder `home`, and its headings.

    None where robot.toml asks for neither, or a magnetometer tells no heading. `notes` and `remarks` grow. InputError
    for what is asked for and is not there, and for positions that cannot be used.
    """
    parts, source, offset_sd = list[Measured](), "", 0.0
    if tables.gps is not None:
        file = home / FILE
        bag = Bag(recording) if is_bag(recording) else None
        listed = [] if bag is None else bag.listed()
        topics = [one for one in listed if one.type == NAVSAT and one.messages]
        if file.exists() and topics:
            raise InputError(f"{recording}: has topic {topics[0].name} as well as {file}, expected one of them.")
        degrees = read_gps_csv(file, remarks) if file.exists() else None
        if degrees is None and bag is not None:
            degrees = read_gps_messages(bag, listed, tables.gps, remarks)
        if degrees is None:
            raise InputError(
                f"{recording}: has no positions, expected {file} or, in a bag, messages of {plain(NAVSAT)}, as {ROBOT} "
                "has [gps]."
            )
        parts.append(measured(degrees, tables.gps, notes, remarks))
        source = degrees.where
    if tables.compass is not None:
        if imu is None or imu.mag is None:
            raise InputError(
                f"{recording}: has no magnetometer, expected mag_x,mag_y,mag_z in imu.csv or messages of "
                f"sensor_msgs/MagneticField beside an IMU's, as {ROBOT} has [compass]."
            )
        found = directions(imu, tables.compass, levels, remarks)
        parts += [] if found is None else [found]
        offset_sd = tables.compass.offset_sd if found is not None else 0.0
    if not parts:
        return None
    found = parts[0] if len(parts) == 1 else joined(*parts)
    return OpenedWorld(found, source, offset_sd, motion, start_given)


def without_compass(opened: OpenedWorld | None) -> OpenedWorld | None:
    """The positions alone; None for none."""
    return None if opened is None else opened.only(("gps",))


def in_world(log: Log, opened: OpenedWorld | None, first: int = 0) -> Log:
    """The log with fixes at its steps from `first` on; itself without any.

    Where nobody gave the start it is that of the fixes. InputError where these do not tell it, and for odometry made
    of them.
    """
    if opened is None:
        return log
    found, motion, remarks = opened.found, opened.motion, list[str]()
    inside = (log.t[first] <= found.t) & (found.t <= log.t[-1])
    own = found.taken(inside & found.placed)
    if len(own.t):
        path = act(path_at(log, own.t, motion), own.arm)
        driven = not isinstance(motion, Drift)
        measured_way = driven and len(path) > 1
        way = ways(path_at(log, own.t, motion)) if measured_way else None
        kept = without_jumps(opened.source, own, way, remarks)
        if measured_way:
            rows = [k for k, at in enumerate(own.t.tolist()) if at in set(kept.t.tolist())]
            remarks += swapped(opened.source, path[rows], kept)
        if opened.start_given and len(kept.t):
            remarks += elsewhere(opened.source, kept, log, driven=driven)
        found = joined(kept, found.taken(~found.placed))
        outside = opened.found.taken(opened.found.placed & ~inside)
        found = joined(outside, found)
    constant = log.prior.systematic._replace(heading_offset=opened.offset_sd)
    log = replace(log, prior=log.prior._replace(systematic=constant))
    made, said = with_fixes(log, found, motion, first)
    if made.fixes is not None and not opened.start_given and log.prior.map is None:
        made = replace(made, prior=start(log, found, motion)._replace(fixes=made.prior.fixes))
    return remarked(made, [*remarks, *said])
