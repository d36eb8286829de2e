"""Inertial readings in a sentence."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .imu import Imu
from .log import FIRST, NOTE, UNKNOWN
from .standing import Standing
from .turns import WITHOUT


def about(imu: Imu, stood: Standing) -> str:
    """The rate, gaps, mounting, share of standing, and bias of the yaw rate."""
    sensors = ["gyro", *["accelerometer"] * (imu.accel is not None), *["magnetometer"] * (imu.mag is not None)]
    gaps = np.diff(imu.gaps, axis=1)[:, 0]
    several = f"{len(gaps)} gaps, the longest of" if len(gaps) > 1 else "a gap of"
    said = [
        f"{', '.join(sensors)} at {imu.rate:.3g} Hz for {imu.t[-1] - imu.t[0]:.4g} s",
        f"{several} {gaps.max():.3g} s" if len(gaps) else "no gap",
        imu.mounting,
    ]
    if stood.bias is None or stood.sd is None:
        said.append(
            f"the robot never stands by its {stood.by}, so the gyro's bias is "
            f"unknown: 0 ± {np.rad2deg(UNKNOWN.sd):.2g} degrees/s is assumed"
        )
    else:
        bias, sd = (float(np.rad2deg(one[2])) for one in (stood.bias, stood.sd))
        said += [
            f"the robot stands in {100 * stood.share:.2g} % of the time by its {stood.by}",
            f"bias of the yaw rate {bias:.3g} ± {sd:.2g} degrees/s",
        ]
    return "; ".join(filter(None, said))


def about_turns(notes: Mapping[str, Any]) -> list[str]:
    """The number of turns, and why steps have none, by the entry of `with_turns` in a log's notes; [] without one."""
    told = notes.get(NOTE)
    if not isinstance(told, Mapping) or FIRST not in told:
        return []
    first = told[FIRST]
    said = [f"{first:,} at the start, with nothing before {'it' if first == 1 else 'them'}"]
    said += [f"{told[reason]:,} {words}" for reason, words in WITHOUT.items() if told.get(reason)]
    turns, without = told["turns"], told["steps_without"]
    have = "has" if without == 1 else "have"
    return [f"turns by the gyro at {turns:,} of {turns + without:,} steps; {without:,} {have} none: {', '.join(said)}"]


def about_levels(told: Mapping[str, Any]) -> str:
    """Says what is levelled and how, in a sentence without its end, by the entry of `Tilts` in a log's notes."""
    pitch, roll = told["own_tilt"]
    ahead, aside = told["rocking"]
    return (
        f"{told.get('of', 'sightings')} are levelled by gravity: pitch and roll are known to {told['sd']:.2g} degrees "
        f"(median), with a push of {told['push']:.2g} m/s^2; the body rocks by {ahead:.2g} and {aside:.2g} degrees, "
        f"and the unit's own pitch of {pitch:.2g} and roll of {roll:.2g} degrees are taken off"
    )
