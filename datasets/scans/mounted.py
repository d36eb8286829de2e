"""The laser scanner's place on the robot: by robot.toml, else by tf, else at the robot's origin."""

from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, wrap
from ..bags.columns import LEVEL
from ..bags.transforms import Transforms

BASES = ("base_link", "base_footprint")  # frames of the robot itself, where no odometry names one
ELSEWHERE, TURNED = 0.05, 0.05  # m and rad by which tf and robot.toml may differ without a remark


class Mounted(NamedTuple):
    """A scanner on a robot."""

    pose: Array  # (3,) of the scanner on the robot
    upside_down: bool = False  # its beams go clockwise as seen from above


def placed(
    where: str, transforms: Transforms, frame: str, base: str | None, given: Array | None, remarks: list[str]
) -> Mounted:
    """The place of the scanner whose frame is `frame` on the robot whose frame is `base`; `remarks` grows.

    `given` (3,) is that of robot.toml and counts. InputError for a scanner that tf says is tilted.
    """
    base = base or next((name for name in BASES if transforms.knows(name)), BASES[0])
    pose = transforms.fixed(base, frame) if frame else None
    if pose is None:
        if given is None:
            remarks.append(
                f"{where}: tf does not tell where {frame or 'the scanner'} is on {base}: taken to be at its origin, "
                "looking ahead; [laser] pose in robot.toml places it"
            )
        return Mounted(np.zeros(3) if given is None else given)
    upright = float(pose[2, 2])
    if abs(upright) < LEVEL:
        tilt = np.rad2deg(np.arccos(np.clip(abs(upright), 0, 1)))
        raise InputError(f"{where}: tf has {frame} tilted by {tilt:.0f} degrees on {base}, expected a level scanner.")
    found = np.array([pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])])
    if given is not None:
        off = given - found
        if np.hypot(off[0], off[1]) > ELSEWHERE or abs(wrap(off[2])) > TURNED:
            remarks.append(
                f"{where}: tf has {frame} at x {found[0]:.3g} m, y {found[1]:.3g} m, heading {found[2]:.3g} rad on "
                f"{base}, [laser] pose, which is used, at {given[0]:.3g}, {given[1]:.3g}, {given[2]:.3g}"
            )
        found = given
    return Mounted(found, upright < 0)
