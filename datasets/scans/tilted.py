"""The levels by which scans of a robot that leans are levelled, where robot.toml asks for it."""

from ...core.errors import InputError
from ...frontend.inertial.tilts import Tilts, tilts, unlevelled
from ...frontend.wheels.motion import Drift, Motion
from ..inertial.open import OpenedImu


def levels_of(where: str, inertial: OpenedImu | None, motion: Motion | None, remarks: list[str]) -> Tilts:
    """The levels of a robot whose robot.toml has [laser] max_tilt or height; InputError where there are none."""
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
        f"{where}: [laser] max_tilt and height need levels by gravity, and {lacking}; expected an accelerometer, [imu] "
        "mounting and wheels, or robot.toml without them."
    )
