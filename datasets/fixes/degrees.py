"""Positions of a receiver in degrees, before they are metres."""

from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.world.measured import Measured, positions
from .geodetic import metres
from .robot import GpsTable

ORIGIN = "origin_degrees"
"""The key, among a log's notes, of latitude and longitude of the origin of its positions."""

FAR, NEAR = 1e5, 0.01
"""m from the origin from which on positions may be swapped, and the share of it that is left where they are."""


class Degrees(NamedTuple):
    """Positions in the order of time."""

    where: str  # they are from, in messages
    t: Array  # (f,) s
    degrees: Array  # (f, 2) latitude and longitude
    cov: Array | None  # (f, 2, 2) m^2, east and north; None: nothing says it


def measured(found: Degrees, table: GpsTable, notes: dict[str, Any], remarks: list[str]) -> Measured:
    """The positions in m, x east and y north of the origin, which `notes` gets; `remarks` where nobody stated it.

    InputError where nothing says how sure they are.
    """
    if table.sd is not None:
        cov = np.tile(table.sd**2 * np.eye(2), (len(found.t), 1, 1))
    elif found.cov is None:
        raise InputError(
            f"{found.where}: nothing says how sure its positions are, expected a column sd, a covariance in messages, "
            "or [gps] sd in robot.toml."
        )
    else:
        cov = found.cov
    origin = found.degrees[0] if table.origin is None else table.origin
    remarks += exchanged(found.where, found.degrees, origin)
    at = f"latitude {origin[0]:.8g}, longitude {origin[1]:.8g}"
    notes["origin"] = f"{at}, x being east and y north"
    notes[ORIGIN] = [float(one) for one in origin]
    if table.origin is None:
        remarks.append(
            f"{found.where}: x and y are metres east and north of its first position, {at}: [gps] origin in robot.toml "
            "states another"
        )
    return positions(found.t + table.time_offset, metres(found.degrees, origin), cov, table.antenna)


def exchanged(where: str, degrees: Array, origin: Array) -> list[str]:
    """The remark on latitudes and longitudes (f, 2) that are far from the origin (2,), and near it if exchanged."""
    far, near = (float(np.median(np.hypot(*metres(some, origin).T))) for some in (degrees, degrees[:, ::-1]))
    if far < FAR or near > NEAR * far:
        return []
    said = (
        f"{where}: latitude and longitude are swapped: the positions are {far / 1e3:,.0f} km from the origin (median), "
        f"latitude {origin[0]:.8g}, longitude {origin[1]:.8g}, and exchanged {near / 1e3:.3g} km"
    )
    return [said]
