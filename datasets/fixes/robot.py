"""[gps] and [compass] of a robot.toml, of a robot of any kind.

    [gps]        topic                                  in a bag with several
                 origin = [latitude, longitude]         degrees; by default of the first position
                 antenna = [x, y], sd, time_offset
    [compass]    declination, sd, offset_sd, every      of the magnetometer of [imu]

Lengths are in m, angles in rad, times in s.
"""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.world.compass import Compass
from ..robot_tables import names_of

GPS, COMPASS = "gps", "compass"

KEYS = ("topic", "origin", "antenna", "sd", "time_offset")


@dataclass(frozen=True, eq=False)
class GpsTable:
    """The table [gps]; None is what it does not say."""

    topic: str | None = None
    origin: Array | None = None  # (2,) degrees
    antenna: Array = field(default_factory=lambda: np.zeros(2))  # (2,) m
    sd: float | None = None  # m, of east and of north, in place of those of the messages or of the file
    time_offset: float = 0.0  # s, added to its times to get those of the wheels' readings

    @property
    def words(self) -> dict[str, Any]:
        """The table as TOML has it, None where it says nothing."""
        return {
            "topic": self.topic,
            "origin": None if self.origin is None else self.origin.tolist(),
            "antenna": self.antenna.tolist(),
            "sd": self.sd,
            "time_offset": self.time_offset or None,
        }


@dataclass(frozen=True, eq=False)
class WorldTables:
    """Both tables; None where robot.toml has none."""

    gps: GpsTable | None = None
    compass: Compass | None = None

    @property
    def words(self) -> dict[str, Any]:
        """The tables as TOML has them."""
        return {
            GPS: {} if self.gps is None else self.gps.words,
            COMPASS: {} if self.compass is None else asdict(self.compass),
        }


def world_in(file: TomlTable) -> WorldTables:
    """[gps] and [compass] of a robot.toml. InputError names a fault's line and key."""
    return WorldTables(_gps(file) if file.has(GPS) else None, _compass(file) if file.has(COMPASS) else None)


def _gps(file: TomlTable) -> GpsTable:
    table = file.table(GPS).only(KEYS)
    origin = table.numbers("origin", 2) if table.has("origin") else None
    if origin is not None and not (abs(origin[0]) < 90 and abs(origin[1]) <= 360):
        raise table.fault("origin", "latitude and longitude, degrees")
    return GpsTable(
        topic=table.text_or_none("topic"),
        origin=origin,
        antenna=table.numbers("antenna", 2, default=(0, 0)),
        sd=table.number("sd", above=0) if table.has("sd") else None,
        time_offset=table.number("time_offset", 0.0),
    )


def _compass(file: TomlTable) -> Compass:
    table = file.table(COMPASS).only(names_of(Compass))
    usual = Compass()
    declination = table.number("declination", 0.0)
    if abs(declination) > np.pi:
        raise table.fault("declination", "radians from -pi to pi")
    return Compass(
        declination,
        table.number("sd", usual.sd, above=0),
        table.number("offset_sd", usual.offset_sd, least=0),
        table.number("every", usual.every, above=0),
    )
