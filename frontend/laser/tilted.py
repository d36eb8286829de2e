"""Scans of a robot that leans: ranges along the floor, and no returns of the floor itself.

A scanner that leans by a measures a wall 1 / cos a farther along the beams that look up or down, and the floor at its
height / tan a. By gravity ranges are made horizontal again; their directions, which change by a^2 / 4 at most, stay.
Where the scanner's height is known, returns of the floor are left out one by one; where there is a limit, all of the
scans at which the robot leans by more.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array
from ..inertial.tilts import LEVELS, Tilts
from .recording import LaserRecording

Mask = NDArray[np.bool_]

BUMPS, SURE = 0.03, 2.0
"""m over the floor, up to which a return is taken to be of it: its bumps, the noise of ranges; and, added to that, the
number of standard deviations of its height by the levels."""


class Leaning(NamedTuple):
    """Limits of the scans, and of the returns, of a robot that leans."""

    most: float | None = None  # rad, beyond which the robot's scans are left out; None: no scan is
    height: float | None = None  # m, of the scanner over the floor, by which returns of it are; None: none is


def levelled(recording: LaserRecording, by: Tilts, leaning: Leaning, remarks: list[str]) -> LaserRecording:
    """The scans with horizontal ranges, without those, and without the returns, that `leaning` leaves out.

    Scans at times without levels stay as they are. The remarks count these, and what is left out. InputError where
    fewer than two scans are left.
    """
    t, most = recording.t, leaning.most
    known = np.array([by.covers(one) for one in t.tolist()])
    pitch, roll, *sd = (np.where(known, np.interp(t, by.t, one), 0.0) for one in (*by.angles.T, *by.sd.T))
    unsure = np.column_stack(sd)
    remarks += by.remarks(t.tolist(), "scans", "their ranges are those of a level robot")
    recording = replace(recording, notes={**recording.notes, LEVELS: {**by.settings, "of": "scans"}})
    if most is not None:
        # The up component of the horizontal plane's directions on a level floor: ahead -pitch, to the left roll.
        steep = np.hypot(np.sin(pitch), np.sin(roll) * np.cos(pitch)) > np.sin(most)
        if (~steep).sum() < 2:
            raise InputError(
                f"{recording.name}: the robot leans by more than max_tilt, {most:g} rad, at {int(steep.sum())} of "
                f"{len(t)} scans, expected at least two below it."
            )
        if steep.any():
            remarks.append(
                f"{recording.name}: the robot leans by more than max_tilt, {most:g} rad, at {int(steep.sum())} of "
                f"{len(t)} scans, the first at {t[steep][0]:.10g} s, which are left out"
            )
        recording = recording.taken(~steep)
        known, pitch, roll, unsure = known[~steep], pitch[~steep], roll[~steep], unsure[~steep]
    at = _directions(recording)
    up = -np.sin(pitch)[:, None] * np.cos(at) + (np.cos(pitch) * np.sin(roll))[:, None] * np.sin(at)
    ranges = np.asarray(recording.ranges, np.float64)
    flat = ranges * np.sqrt(1 - up**2)
    if leaning.height is not None:
        returned = (ranges > recording.scanner.least) & (ranges < recording.scanner.most)
        margin = BUMPS + SURE * ranges * np.hypot(unsure[:, :1] * np.cos(at), unsure[:, 1:] * np.sin(at))
        low = returned & known[:, None] & (leaning.height + ranges * up < margin)
        flat[low] = np.nan
        _tell(recording, low, returned, remarks)
    return replace(recording, ranges=flat.astype(recording.ranges.dtype))


def _directions(recording: LaserRecording) -> Array:
    """(n, b) or (1, b) rad, of the beams about the robot."""
    angles: Sequence[Array | None] = [recording.scanner.angles]
    if recording.fans is not None:
        angles = [recording.angles(k) for k in range(len(recording.t))]
    return np.array(angles, np.float64) + recording.scanner.pose[2]


def _tell(recording: LaserRecording, low: Mask, returned: Mask, remarks: list[str]) -> None:
    """Adds the remark on returns of the floor."""
    if low.any():
        remarks.append(
            f"{recording.name}: {100 * low.sum() / returned.sum():.2g} % of the returns are of the floor, as the robot "
            f"leans: they are left out, in {int(low.any(axis=1).sum())} of {len(low)} scans"
        )
