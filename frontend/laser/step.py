"""A step of the log that a front end makes."""

from typing import NamedTuple

from ...core.se2 import Array


class Step(NamedTuple):
    """The pose of a scan, and the motion since the step before."""

    t: float
    scan: int  # its number
    pose: Array  # (3,) on the matcher's path
    delta: Array  # (3,) from the step before
    cov: Array  # (3, 3) in the axes of delta
