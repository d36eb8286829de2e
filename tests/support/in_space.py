"""Beams of a scanner on a body that leans, in space: turned about one axis after the other."""

import numpy as np

from slamduel.core.se2 import Array

AHEAD, LEFT = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def about(axis: Array, angle: float, points: Array) -> Array:
    """The points (n, 3) turned about a unit axis (3,), counter-clockwise as seen from its tip (Rodrigues' formula)."""
    along = np.outer(points @ axis, axis)
    return along + np.cos(angle) * (points - along) + np.sin(angle) * np.cross(axis, points)


def beams_in_space(angles: Array, pitch: float, roll: float) -> Array:
    """(b, 3) unit vectors of beams at `angles` (b,), rad, x ahead and z up.

    The body rolls to its right about the axis ahead, and then pitches: its nose goes down about the level axis to the
    left.
    """
    beams = np.column_stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
    return about(LEFT, pitch, about(AHEAD, roll, beams))
