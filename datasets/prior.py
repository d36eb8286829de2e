"""Reads the table [prior] of a robot.toml: where the robot starts, and how certain that is."""

import numpy as np

from ..core.factors import Prior
from ..core.se2 import Array
from ..core.toml.table import TomlTable

START_SD = 1e-3  # m and rad: without [prior] the robot starts at the origin, which is defined by it


def assumed(pose: Array | None = None) -> Prior:
    """The prior of a robot whose start nobody gave: `pose` (3,), else the origin."""
    return Prior(np.zeros(3) if pose is None else pose, START_SD**2 * np.eye(3))


def read_prior(prior: TomlTable) -> Prior:
    """Reads `pose`, x, y (m) and heading (rad), and `sd` of each; InputError names the line and key of a fault."""
    prior = prior.only(("pose", "sd"))
    pose, sd = prior.numbers("pose", 3, default=(0, 0, 0)), prior.numbers("sd", 3, default=[START_SD] * 3)
    if abs(pose[2]) > np.pi:
        raise prior.fault("pose", "a heading from -pi to pi, in radians")
    if sd.min() <= 0:
        raise prior.fault("sd", "3 numbers above 0")
    return Prior(pose, np.diag(np.square(sd)))
