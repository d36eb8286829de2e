"""The sensors of a recording, and which of them a log is made of."""

from collections.abc import Collection
from dataclasses import replace
from typing import TypeVar

from ...core.errors import InputError, nearest
from ...core.options import parts
from ..depth.open import OpenedDepth
from ..fixes.open import OpenedWorld
from ..scans.open import OpenedScans
from .recording import Opened

MARKERS, LASER, DEPTH = SEEING = ("markers", "laser", "depth")
"""Those that see, by the tables of robot.toml: each has a front end."""

WHEELS, GYRO, COMPASS, GPS = BESIDE = ("wheels", "gyro", "compass", "gps")
"""Those beside them."""

SENSORS = (*SEEING, *BESIDE)

ALL = "all"  # those that the recording has


def sensors_in(text: str, flag: str) -> tuple[str, ...] | None:
    """The sensors that a `text` names, a list as `core.options.parts` reads it; None for ALL.

    InputError for one that there is not, that is twice, and for none that sees.
    """
    if text.strip() == ALL:
        return None
    if not text.strip():
        raise InputError(f"{flag}: found an empty name, expected {ALL}, or some of {', '.join(SENSORS)}.")
    names = parts(text)
    for name in names:
        if name not in SENSORS:
            raise InputError(f"{flag} {text}: found {name!r}; {nearest(name, SENSORS)}")
    if len(set(names)) < len(names):
        raise InputError(f"{flag} {text}: a sensor is named twice, expected once.")
    if not set(names) & set(SEEING):
        raise InputError(
            f"{flag} {text}: none of them sees, expected {', '.join(SEEING)} among them; csv[...] makes logs of "
            "odometry, positions and headings alone."
        )
    return tuple(names)


def seeing(sensors: Collection[str] | None) -> tuple[str, ...] | None:
    """Those named that see; None where none is named."""
    return None if sensors is None else tuple(one for one in SEEING if one in sensors)


def beside_them(sensors: Collection[str] | None) -> tuple[str, ...]:
    """Those of the others that are used: all where none of them is named."""
    return tuple(one for one in BESIDE if sensors is not None and one in sensors) or BESIDE


_Opened = TypeVar("_Opened", Opened, OpenedScans, OpenedDepth)


def chosen(opened: _Opened, sensors: Collection[str] | None) -> _Opened:
    """The recording of one front end with those beside it that are named; InputError where it lacks wheels it needs."""
    if sensors is None:
        return opened
    kept = beside_them(sensors)
    if GYRO not in kept:
        opened = opened.without_gyro()
    world: OpenedWorld | None = None if opened.world is None else opened.world.only(kept)
    if WHEELS not in kept and not isinstance(opened, Opened):
        world = None if world is None else world._replace(motion=None)
        if isinstance(opened, OpenedScans):
            opened = opened._replace(recording=replace(opened.recording, odometry=None))
        else:
            if opened.settings.odometry == "wheels":
                raise InputError(
                    f"{opened.recording.name}: the sensors are without wheels, and [depth] takes the motion from "
                    'these; expected odometry = "visual" and landmarks = false in robot.toml.'
                )
            opened = opened._replace(recording=replace(opened.recording, motion=None))
    return opened._replace(world=world)
