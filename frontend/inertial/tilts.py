"""A body's pitch and roll at the times of camera frames, by gravity, relative to how it leans on average.

On average over a drive the body is taken to be level, as `mounting` of its cameras is of a robot on its wheels: the
mean of the levels is then the unit's own tilt on the robot, of which no mounting tells the last degree, together with
the accelerometer's offset. Beside the levels stands what the robot is known to rock: each has its standard deviation,
and the mean of both, weighted by their inverse squares, is surer than either. Levels that a lively drive leaves wide so
move a sighting by little, and never make it less certain than the rocking alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ..wheels.motion import Drift, Motion
from .imu import GRAVITY, SELDOM, Imu, spanned
from .levels import OFFSET, Levels, levels
from .standing import Standing

LEVELS = "levels"  # by gravity, among a log's notes

STEEP = np.deg2rad(20.0)  # mean tilt beyond which the axes are others than stated, and levels mean nothing
UNSURE = 3.0  # times the median standard deviation of a level, beyond which one after a gap is too uncertain
RAMP, LASTS = (
    np.deg2rad(2.0),
    2.0,
)  # rad, s: a mean level over that time that is further off is of a ramp, not of rocking
BLOCKS = 8  # parts of a drive whose means scatter by how unsure the mean of all is
SPAN, GRID = 1.0, 0.05  # s over which the wheels' speed is a mean, and between the motions that it is made of


class Tilt(NamedTuple):
    """The lean of a body at one time."""

    turn: Array  # (4, 4) T_level_robot
    leaning: Array  # (2, 3) rad, turns about the level robot's axes: one standard deviation of pitch, and of roll


@dataclass(frozen=True, eq=False)
class Tilts:
    """The lean of a body, at the readings of its inertial measurement unit."""

    t: Array  # (n,) s
    angles: Array  # (n, 2) rad, pitch and roll, each 0 on average
    sd: Array  # (n, 2) rad
    own: Array  # (n,) rad, the larger one without what the mean is unsure of
    missing: NDArray[np.bool_]  # (n - 1,) between which readings others are missing
    unsure: NDArray[np.bool_]  # (n,) the level is too uncertain: soon after a gap
    rocking: Array  # (2,) rad, standard deviations of pitch and roll over the drive, without the levels' own errors
    mean: Array  # (2,) rad, pitch and roll of the unit that were taken off
    levels: Levels  # of the unit itself
    source: str = "imu"  # name of the readings in messages

    def covers(self, t: float) -> bool:
        """True where there are readings around `t`, s, whose levels are certain enough."""
        row = self._row(t)
        return self._felt(t) and not bool(self.unsure[row] or self.unsure[row + 1])

    def _felt(self, t: float) -> bool:
        """True where there are readings around `t`, s."""
        return bool(self.t[0] <= t <= self.t[-1]) and not bool(self.missing[self._row(t)])

    def remarks(self, t: Sequence[float], of: str, left: str) -> list[str]:
        """Sentences without their ends on those of the frames or scans at `t`, s, that are not levelled.

        `of` names them, and `left` says what they are left with.
        """
        without = [one for one in t if not self.covers(one)]
        unfelt, most = sum(not self._felt(one) for one in without), UNSURE * float(np.rad2deg(np.median(self.own)))
        counts = {
            "has no readings around": unfelt,
            f"soon after a gap pitch and roll are known to no better than {most:.2g} degrees at": len(without) - unfelt,
        }
        return [
            f"{self.source}: {said} the times of {count:,} of {len(t):,} {of}, which are not levelled: {left}"
            for said, count in counts.items()
            if count
        ]

    def _row(self, t: float) -> int:
        return min(int(np.searchsorted(self.t, t, "right")) - 1, len(self.t) - 2)

    def at(self, t: float, sway: float) -> Tilt | None:
        """The tilt at `t`, s, of a body that rocks by `sway`, rad, or by more where the levels show it.

        None before and after the readings, in their gaps and soon after these, and for a body that does not rock.
        """
        known = np.maximum(self.rocking, sway) ** 2
        if not self.covers(t) or not known.any():
            return None
        row = self._row(t)
        share = (t - self.t[row]) / (self.t[row + 1] - self.t[row])
        (pitch, roll), sd = (one[row] + share * (one[row + 1] - one[row]) for one in (self.angles, self.sd))
        kept = known / (known + sd**2)
        pitch, roll = kept[0] * pitch, kept[1] * roll
        pitching, rolling = sd * np.sqrt(kept)
        turn = np.eye(4)
        turn[:3, :3] = leaned(pitch, roll)
        # A body that looks down and rolls turns its heading as well.
        return Tilt(turn, np.array([[0, pitching, 0], [rolling * np.cos(pitch), 0, -rolling * np.sin(pitch)]]))

    @property
    def settings(self) -> dict[str, Any]:
        """The entry in a log's notes: in degrees, and the push in m/s^2."""
        return {
            "sd": float(np.rad2deg(np.median(self.sd))),
            "rocking": np.rad2deg(self.rocking).tolist(),
            "own_tilt": np.rad2deg(self.mean).tolist(),
            "push": self.levels.push,
            "lasting": self.levels.lasting,
        }


def tilts(imu: Imu, stood: Standing | None, motion: Motion, remarks: list[str]) -> Tilts | None:
    """The tilts of a body by its readings; the wheels' speed takes the robot's own acceleration off.

    None where they are `unlevelled`, and, with one of the `remarks`, where gravity is not along the robot's z axis.
    Another one is of ramps.
    """
    if unlevelled(imu, motion):
        return None
    speed = speeds(motion, imu.t)
    found = levels(imu, stood, speed)
    angles = np.column_stack((found.pitch, found.roll))
    offset = (OFFSET / GRAVITY) ** 2  # which goes with the mean
    own = np.column_stack((found.pitch_sd, found.roll_sd)) ** 2 - offset
    wider = np.sqrt(own.max(axis=1))
    unsure = (wider > UNSURE * np.median(wider)) & np.append(False, np.cumsum(imu.missing) > 0)
    known = angles[~unsure]
    mean = known.mean(axis=0)
    steep = float(np.arccos(np.clip((np.cos(known[:, 0]) * np.cos(known[:, 1])).mean(), -1, 1)))
    if not steep < STEEP:
        remarks.append(
            f"{imu.source}: by gravity the robot leans by {np.rad2deg(steep):.0f} degrees on average, "
            f"expected at most {np.rad2deg(STEEP):.0f}: sightings are not levelled"
        )
        return None
    angles, known = angles - mean, known - mean
    of_mean = np.array([part.mean(axis=0) for part in np.array_split(known, BLOCKS)]).var(axis=0, ddof=1) / BLOCKS
    apart = imu.missing[1:] | imu.missing[:-1] | unsure[2:] | unsure[1:-1] | unsure[:-2]
    between = np.diff(angles, n=2, axis=0)[~apart]
    bent = (between**2).mean(axis=0) / 64 if len(between) else np.zeros(2)  # a straight line is off by up to 1/8
    rocking = np.sqrt(np.maximum((known**2 - own[~unsure]).mean(axis=0) - of_mean, 0.0))
    sd = np.sqrt(own + of_mean + bent)
    remarks += _ramps(imu, angles, float(np.sqrt(of_mean.max())))
    return Tilts(imu.t, angles, sd, wider, imu.missing, unsure, rocking, mean, found, imu.source)


def _ramps(imu: Imu, angles: Array, unsure: float) -> list[str]:
    """The remark on a robot that leans longer than it rocks, [] without; the mean is known to `unsure`, rad."""
    count = max(round(LASTS * imu.rate), 1)
    if count > len(angles):
        return []
    ways = np.concatenate((np.zeros((1, 2)), np.cumsum(angles - np.median(angles, axis=0), axis=0)))
    means = np.abs(ways[count:] - ways[:-count]).max(axis=1) / count
    lost = np.concatenate(([0], np.cumsum(imu.missing)))
    means = means[lost[count - 1 :] == lost[: len(lost) - count + 1]]  # of readings without a gap
    steep = means > RAMP
    if not steep.any():
        return []
    said = (
        f"{imu.source}: the robot leans by up to {np.rad2deg(means.max()):.2g} degrees for {LASTS:g} s or longer, "
        f"{steep.sum() * imu.usual:.2g} s in all, as on a ramp: it is levelled there, but the wheels' way is along the "
        f"slope, and the mean that is taken off as the unit's own tilt is unsure by {np.rad2deg(unsure):.2g} degrees"
    )
    return [said]


def unlevelled(imu: Imu, motion: Motion) -> str:
    """Why readings do not level a body, in words; empty where they do, but for gravity along another axis."""
    if imu.accel is None:
        return "there is no accelerometer"
    if len(imu) < 3 * BLOCKS:
        return f"there are {len(imu)} readings, expected at least {3 * BLOCKS}"
    if imu.seldom:
        return f"readings come at {imu.rate:.3g} Hz (median), expected at least {SELDOM:g} to follow a body that rocks"
    if imu.doubt:
        return imu.doubt
    if not imu.placed:
        return "neither robot.toml nor tf says how the unit is mounted"
    if isinstance(motion, Drift):
        return "nothing measured the robot's speed, and an even curve looks like a slope"
    if not _together(motion, imu.t):
        return (
            f"its times, {spanned(imu.t)}, and those of the {motion.readings}, {spanned(motion.t)}, have less than "
            f"{SPAN:g} s in common"
        )
    return ""


def speeds(motion: Motion, t: Array) -> Array | None:
    """(n,) m/s ahead at `t` (n,), s, as means over `SPAN`; None where nothing measured the motion."""
    if isinstance(motion, Drift) or len(motion.t) < 2:
        return None
    if not _together(motion, t):
        return None
    begin, end = max(float(motion.t[0]), float(t[0])), min(float(motion.t[-1]), float(t[-1]))
    at = np.linspace(begin, end, int((end - begin) / GRID) + 1)
    ahead = [motion.odometry(a, b).delta[0] for a, b in zip(at[:-1].tolist(), at[1:].tolist(), strict=True)]
    way = np.concatenate(([0.0], np.cumsum(ahead)))
    # A robot that sets out is not yet at speed: means are shorter there, and go straight on to the very end.
    half = np.minimum(SPAN / 2, np.minimum(at - begin, end - at))[1:-1]
    inner = (np.interp(at[1:-1] + half, at, way) - np.interp(at[1:-1] - half, at, way)) / (2 * half)
    ends = 2 * inner[[0, -1]] - inner[[1, -2]]
    return np.interp(t, at, np.concatenate((ends[:1], inner, ends[1:])))


def _together(motion: Motion, t: Array) -> bool:
    """True where readings of both are at one time for long enough."""
    return bool(min(motion.t[-1], t[-1]) - max(motion.t[0], t[0]) >= SPAN)


def leaned(pitch: Array | float, roll: Array | float) -> Array:
    """(..., 3, 3) from a robot pitched by `pitch` forward and rolled by `roll` to the right, rad, to a level one."""
    (cp, sp), (cr, sr) = (np.cos(pitch), np.sin(pitch)), (np.cos(roll), np.sin(roll))
    rows = ((cp, sp * sr, sp * cr), (0 * cp, cr, -sr), (-sp, cp * sr, cp * cr))
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)
