"""The options of a log from CSV tables: files, units and noise."""

from dataclasses import dataclass

import numpy as np

from ...core.errors import InputError
from ...core.mounting import Mounting
from ...core.options import option, parts
from ...core.se2 import Array, wrap
from ..inertial.robot import ImuTable, turned
from ..inertial.units import UNITS, Says
from ..registry import Named

BEYOND, NOISE, MOST_BEYOND = 0.1, 6.0, 0.5
"""rad, or standard deviations, by which noise may bring a bearing beyond half a turn, and rad at most."""

IMU_SAYS = Says(
    gyro="option imu_gyro",
    accelerometer="option imu_accelerometer",
    magnetometer="a header such as mag_x [uT]",
    mounting="option imu_roll, imu_pitch or imu_yaw",
    mounted="option imu_roll, imu_pitch or imu_yaw",
    offset="option imu_delay={delay:.3f}",
    times="option imu_delay",
)

ANGLED = ("odometry", "detections", "bearings", "headings", "truth")  # files that have angles
RANGED = ("detections", "ranges")  # files that have ranges
SIGHTED = ("detections", "ranges", "bearings")  # files of sightings


@dataclass(frozen=True)
class Options(Named):
    """The files and their noise."""

    odometry: str | None = option(None, "CSV file with t,x,y,heading or t,dx,dy,dtheta or t,v,omega")
    speeds: str = option(
        "until-next",
        "v and omega of a row are those until the next row, those since the row before, or those at its time",
        choices=("until-next", "since-last", "at-time"),
        beside="odometry",
    )
    detections: str | None = option(None, "CSV file with t,id,range,bearing or t,id,x,y; id -1 is unknown")
    ranges: str | None = option(None, "CSV file with t,id,range: ranges alone, with range_sd and range_share")
    bearings: str | None = option(None, "CSV file with t,id,bearing: bearings alone, with bearing_sd")
    positions: str | None = option(None, "CSV file with t,x,y or, in degrees, t,lat,lon, and perhaps sd, m")
    headings: str | None = option(None, "CSV file with t,heading, of a compass, and perhaps sd, rad")
    imu: str | None = option(None, "CSV file with t,gyro_x,gyro_y,gyro_z, whose turns are beside the odometry")
    imu_gyro: str | None = option(
        None,
        "unit of its rates, where its header says none; not given: as the readings show it",
        choices=tuple(UNITS["gyro"]),
        beside="imu",
    )
    imu_accelerometer: str | None = option(
        None, "likewise of accelerations", choices=tuple(UNITS["accelerometer"]), beside="imu"
    )
    imu_roll: float | None = option(
        None,
        "turn of its axes on the robot's, about x first, rad; pi: upside down; not given: as gravity shows it",
        minimum=-2 * np.pi,
        maximum=2 * np.pi,
        beside="imu",
    )
    imu_pitch: float | None = option(
        None, "likewise, about y then, rad", minimum=-2 * np.pi, maximum=2 * np.pi, beside="imu"
    )
    imu_yaw: float | None = option(
        None, "likewise, about z at last, rad", minimum=-2 * np.pi, maximum=2 * np.pi, beside="imu"
    )
    imu_delay: float = option(
        0.0, "s by which its clock is later than the odometry's", minimum=-1e6, maximum=1e6, beside="imu"
    )
    truth: str | None = option(None, "CSV file with t,x,y,heading, or a TUM file")
    landmarks: str | None = option(None, "CSV file with the landmarks' true positions: id,x,y")
    ignore: str = option(
        "", "ids to leave out, such as those of moving objects: 5,14,23", parted=";", beside="detections"
    )
    angles: str = option(
        "radians", "unit of all angles, radians or degrees, or the files with degrees: odometry,truth", parted=";"
    )
    range_sd: float = option(0.1, "standard deviation of a range, m", minimum=1e-6, maximum=1e3, beside=RANGED)
    range_share: float = option(
        0.0, "growth of that with the range, as a share of the range", minimum=0.0, maximum=1.0, beside=RANGED
    )
    bearing_sd: float = option(
        0.02, "standard deviation of a bearing, rad", minimum=1e-6, maximum=3.0, beside=("detections", "bearings")
    )
    xy_sd: float | None = option(
        None,
        "standard deviation of x and of y of t,id,x,y, m, in place of these three",
        minimum=1e-6,
        maximum=1e3,
        beside="detections",
    )
    signature_sd: float | None = option(
        None,
        "standard deviation of the detections' column signature, which is then used",
        minimum=1e-12,
        maximum=1e12,
        beside="detections",
    )
    position_sd: float | None = option(
        None,
        "standard deviation of x and of y of positions, m, that have none",
        minimum=1e-6,
        maximum=1e6,
        beside="positions",
    )
    origin_lat: float | None = option(
        None,
        "latitude of the origin, degrees; not given: the first one's",
        minimum=-90,
        maximum=90,
        beside="positions",
    )
    origin_lon: float | None = option(None, "its longitude", minimum=-360, maximum=360, beside="positions")
    antenna_x: float = option(0.0, "place of the antenna, m ahead", minimum=-99, maximum=99, beside="positions")
    antenna_y: float = option(0.0, "likewise, m to the left", minimum=-99, maximum=99, beside="positions")
    heading_sd: float = option(
        0.05, "standard deviation of headings, rad, that have none", minimum=1e-6, maximum=3.0, beside="headings"
    )
    headings_from: str = option(
        "x", "headings are counter-clockwise from x, or clockwise from north", choices=("x", "north"), beside="headings"
    )
    declination: float = option(
        0.0, "by which magnetic north is east of north, rad", minimum=-np.pi, maximum=np.pi, beside="headings"
    )
    range_scale: float = option(
        0.0, "standard deviation of an unknown scale of ranges alone", minimum=0.0, maximum=1.0, beside="ranges"
    )
    range_offset: float = option(0.0, "likewise of their offset, m", minimum=0.0, maximum=1e3, beside="ranges")
    heading_offset: float = option(
        0.0, "likewise of a constant error of headings, rad", minimum=0.0, maximum=3.0, beside="headings"
    )
    forward: float = option(0.05, "motion noise, m per root metre driven", minimum=0.0, maximum=10.0)
    turning: float = option(0.03, "motion noise, rad per root metre driven", minimum=0.0, maximum=10.0)
    turning_by_turn: float = option(0.05, "motion noise, rad per root radian turned", minimum=0.0, maximum=10.0)
    floor_position: float = option(1e-3, "motion noise of every factor, m", minimum=1e-6, maximum=10.0)
    floor_heading: float = option(1e-3, "motion noise of every factor, rad", minimum=1e-6, maximum=3.0)
    every: float = option(1.0, "longest time between keyframes, s", minimum=1e-3, maximum=1e6)
    max_speed: float = option(50.0, "faster motion counts as a misreading, m/s", minimum=1e-3, maximum=1e6)
    sensor_x: float = option(
        0.0, "where the sensor sits on the robot: m ahead of its origin", minimum=-99, maximum=99, beside="detections"
    )
    sensor_y: float = option(0.0, "likewise, m to the left", minimum=-99, maximum=99, beside="detections")
    sensor_yaw: float = option(
        0.0, "where it looks: rad counter-clockwise from ahead", minimum=-np.pi, maximum=np.pi, beside="detections"
    )
    sensor_delay: float = option(
        0.0,
        "s by which the clock of the detections is later than the odometry's",
        minimum=-1e6,
        maximum=1e6,
        beside=SIGHTED,
    )
    start_x: float | None = option(None, "initial x, m; not given: from the ground truth, else 0")
    start_y: float | None = option(None, "initial y, m")
    start_heading: float | None = option(None, "initial heading, rad", minimum=-np.pi, maximum=np.pi)
    start_sd: float | tuple[float, float] = option(
        1e-3, "standard deviation of the initial pose: of m and rad alike, or of m,rad", minimum=1e-9, maximum=1e3
    )

    @property
    def sensor(self) -> Mounting:
        """The sensor's place, and how late it is."""
        return Mounting(self.sensor_x, self.sensor_y, self.sensor_yaw, self.sensor_delay)

    @property
    def imu_table(self) -> ImuTable:
        """The units, the mounting and the delay of the inertial readings, as the options say them."""
        angles = self.imu_roll, self.imu_pitch, self.imu_yaw
        told = any(angle is not None for angle in angles)
        return ImuTable(
            mounting=turned(*(angle or 0.0 for angle in angles)) if told else None,
            gyro=self.imu_gyro,
            accelerometer=self.imu_accelerometer,
            time_offset=-self.imu_delay,
            says=IMU_SAYS,
        )

    def in_degrees(self) -> tuple[str, ...]:
        """Parses the files whose angles are in degrees, of ANGLED."""
        if self.angles in ("radians", "degrees"):
            return ANGLED if self.angles == "degrees" else ()
        names = parts(self.angles)
        for name in names:
            if name not in ANGLED:
                raise InputError(
                    f"option angles={self.angles} of dataset csv: found {name!r}, expected radians, degrees, or the "
                    f"files whose angles are in degrees, of {', '.join(ANGLED)}."
                )
        return tuple(name for name in ANGLED if name in names)

    def unit(self, file: str) -> float:
        """The unit of the angles in one of ANGLED, rad."""
        return np.pi / 180 if file in self.in_degrees() else 1.0

    def with_degrees(self, file: str) -> str:
        """The option that reads the angles of `file` as degrees, too, and all others as now."""
        names = {*self.in_degrees(), file}
        return f"angles={','.join(name for name in ANGLED if name in names)}"

    @property
    def largest_bearing(self) -> float:
        """rad, up to which a bearing is one beyond half a turn by its noise, and wrapped."""
        return np.pi + min(max(BEYOND, NOISE * self.bearing_sd), MOST_BEYOND)


def within_half(bearing: Array) -> Array:
    """(n,) rad, those beyond half a turn wrapped, the others as they are."""
    return np.where(np.abs(bearing) > np.pi, wrap(bearing), bearing)
