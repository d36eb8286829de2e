"""A robot's motion by its scans alone, as relative poses between the steps of a laser front end.

The front end holds each scan to the motion of the wheels while it matches it: its pose p minimises

    (x - m)' H (x - m) + (x - h)' W (x - h)

with the place m of the scan's points and the slope H of their score, and the place h and information W of the wheels.
Where p, H, h and W are known, m is too:

    m = h + H^-1 (H + W) (p - h)

That is exact where matching is linear, and the log has the wheels as a factor of their own: counted once. Along a
corridor H has next to nothing. There, m is held to h by WEAK, hundreds of times weaker than wheels.

A step relates to the first one within NEAR that the submap has in which it was matched. Both are measured on that
submap, each with the covariance of its own match: while the robot stays near, as in a room, the error does not grow
from one step to the next, as it would in a chain. Farther apart the submap's own bend would be larger than the error of
a match: on a made-up floor the normalised error of motions to the submap's first step is 1.7, within 2.5 m 1.1.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints, between, wrap
from ...core.small_matrices import inverse
from ..laser._matching import USUAL
from ..laser.front_end import FrontEnd, KeyScan
from ..laser.loops import WEAK, cov_between, cov_by_points

NEAR = 2.5
"""m between two steps that saw much of the same walls."""


class Motions(NamedTuple):
    """Relative poses (m): of a step in the axes of an earlier one."""

    at: Ints  # (m,) the step, of the front end's
    to: Ints  # (m,) the earlier one
    delta: Array  # (m, 3)
    cov: Array  # (m, 3, 3) in the axes of delta
    places: Array  # (k, 3) of all steps, on the matcher's path


def scan_motions(front_end: FrontEnd) -> Motions:
    """The motions that the scans of a front end tell; none to a step whose scan was placed by the wheels."""
    s, keys = front_end.settings, front_end.keys
    places = [place_by_points(key) for key in keys]
    told = [k for k, key in enumerate(keys) if k and key.hold is not None and key.counts]
    covs = [cov_by_points(key.slope, key.scatter, s) for key in keys]
    if told:
        covs[0] = covs[told[0]]  # the first scan is the submap: as uncertain as the next one's match
    at, to = np.array(told, np.int64), np.array([_base(k, keys[k].base, places) for k in told], np.int64)
    delta, cov = np.zeros((len(told), 3)), np.zeros((len(told), 3, 3))
    for row, (k, base) in enumerate(zip(told, to.tolist(), strict=True)):
        delta[row] = between(places[base], places[k])
        own = cov_between(places[base], places[k], covs[base], covs[k])
        own += keys[k].stale + keys[base].stale
        own += sum(key.doubt for key in keys[base + 1 : k + 1])
        cov[row] = (own + own.T) / 2
    return Motions(at, to, delta, cov, np.array(places))


def place_by_points(key: KeyScan) -> Array:
    """The place (3,) of a scan by its points alone, on the matcher's path."""
    if key.hold is None:
        return key.pose
    off = key.pose - key.hold.pose
    off[2] = wrap(off[2])
    place = key.hold.pose + inverse(key.slope + USUAL * WEAK) @ (key.slope + key.hold.information) @ off
    place[2] = wrap(place[2])
    return place


def _base(k: int, first: int, places: Sequence[Array]) -> int:
    """The first step from `first` on that is near step k; the one before where none is."""
    off = np.array(places[first:k])[:, :2] - places[k][:2]
    near = np.flatnonzero(np.hypot(*off.T) < NEAR)
    return first + int(near[0]) if len(near) else k - 1
