"""Scans of a robot that leans: ranges along the floor, and none of scans that see the floor.

A scanner that leans by a measures a wall 1 / cos a farther along the beams that look up or down, and the floor at its
height / tan a. By gravity ranges are made horizontal again; their directions, which change by a^2 / 4 at most, stay.
Where the robot leans by more than [laser] max_tilt a scan is left out.
"""

from dataclasses import replace

import numpy as np

from ...core.errors import InputError
from ...frontend.inertial.tilts import Tilts, tilts, unlevelled
from ...frontend.laser.recording import LaserRecording
from ...frontend.wheels.motion import Drift, Motion
from ..inertial.open import OpenedImu


def levels_of(where: str, inertial: OpenedImu | None, motion: Motion | None, remarks: list[str]) -> Tilts:
    """The levels of a robot whose robot.toml has [laser] max_tilt; InputError where there are none."""
    imu = None if inertial is None else inertial.imu
    lacking = "there are no inertial readings" if imu is None else unlevelled(imu, motion or Drift(1.0, 1.0))
    if not lacking and imu is not None and inertial is not None and motion is not None:
        said = list[str]()
        found = tilts(imu, inertial.stood, motion, said)
        if found is not None:
            remarks += [one for one in said if one not in remarks]
            return found
        lacking = "gravity is along another axis"
    raise InputError(
        f"{where}: [laser] max_tilt needs levels by gravity, and {lacking}; expected an accelerometer, [imu] mounting "
        "and wheels, or robot.toml without max_tilt."
    )


def levelled(recording: LaserRecording, by: Tilts, most: float, remarks: list[str]) -> LaserRecording:
    """The scans with horizontal ranges, without those at which the robot leans by more than `most`, rad.

    Scans at times without levels stay as they are, and so do ranges where the angles of scans vary. InputError where
    fewer than two are left.
    """
    t = recording.t
    known = np.array([by.covers(one) for one in t.tolist()])
    pitch, roll = (np.where(known, np.interp(t, by.t, angle), 0.0) for angle in by.angles.T)
    # The up component of the horizontal plane's directions on a level floor: ahead -pitch, to the left roll.
    steep = np.hypot(np.sin(pitch), np.sin(roll) * np.cos(pitch)) > np.sin(most)
    if (~steep).sum() < 2:
        raise InputError(
            f"{recording.name}: the robot leans by more than {most:g} rad at {int(steep.sum())} of {len(t)} scans, "
            "expected at least two below [laser] max_tilt."
        )
    if steep.any():
        remarks.append(
            f"{recording.name}: the robot leans by more than {most:g} rad, [laser] max_tilt, at {int(steep.sum())} of "
            f"{len(t)} scans, the first at {t[steep][0]:.10g} s, which are left out"
        )
    taken, pitch, roll = recording.taken(~steep), pitch[~steep, None], roll[~steep, None]
    if taken.fans is not None:
        return taken
    at = recording.scanner.angles + recording.scanner.pose[2]
    up = -np.sin(pitch) * np.cos(at) + np.cos(pitch) * np.sin(roll) * np.sin(at)
    return replace(taken, ranges=(taken.ranges * np.sqrt(1 - up**2)).astype(taken.ranges.dtype))
