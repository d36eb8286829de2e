"""Landmarks that move, such as people and carts: a fault of a simulated world, as no backend here models motion."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.elementary import sincos
from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, wrap
from ...core.truth.errors import rows_of, sighted_from

PAUSES = (5.0, 15.0)
"""s, from the shortest to the longest, that a landmark stands and then goes; each has its own."""


def moved(
    log: Log, truth: Truth, share: float, motion: str, speed: float, roaming: float, rng: np.random.Generator
) -> tuple[Log, Truth, NDArray[np.bool_]]:
    """Lets a random `share` of the landmarks move at `speed` m/s, in x and y at most `roaming` m from where they were.

    A landmark goes along a line from its place at its first sighting, which is that of the map, and turns back at the
    border; if `motion` is stop-and-go, it first stands. Sightings keep their errors, and are still those of the steps
    in which that place is in view; a mask (s,) has those in which the landmark is, too: within the true ranges and
    bearings of the log without motion. The truth's `moving` has the ids. Each landmark draws the same for every share.
    """
    assert truth.map is not None
    chosen = rng.uniform(size=len(truth.map.ids)) < share
    s, c = sincos(rng.uniform(0, 2 * np.pi, len(chosen)))
    pause = rng.uniform(*PAUSES, len(chosen))
    row, step = rows_of(truth.map.ids, log.ids), log.sighting_step
    going = log.t[step] - _first(log.t[step], row, len(chosen))[row]
    if motion == "stop-and-go":
        laps = np.floor(going / (2 * pause[row]))
        going = laps * pause[row] + np.maximum(0.0, going - (2 * laps + 1) * pause[row])
    way, place = speed * going, truth.map.xy[row]
    now = place + np.stack((_folded(way * c[row], roaming), _folded(way * s[row], roaming)), axis=-1)
    before, after = (_seen(truth.poses[step], xy) for xy in (place, now))
    moves, ids = chosen[row], truth.map.ids[chosen]
    z = np.where(moves[:, None], log.z + after - before, log.z)
    z[:, 1] = wrap(z[:, 1])
    z.flags.writeable = ids.flags.writeable = False
    return replace(log, z=z), truth._replace(moving=ids), ~moves | _within(before, after)


def _seen(poses: Array, xy: Array) -> Array:
    right = sighted_from(poses, xy)
    right[:, 1] = wrap(right[:, 1])
    return right


def _within(view: Array, sightings: Array) -> NDArray[np.bool_]:
    """(s,) mask of `sightings` (s, 2) between the ranges of `view` (v, 2) and within its widest bearing."""
    near, far = view[:, 0].min(initial=np.inf), view[:, 0].max(initial=0.0)
    ahead = np.abs(sightings[:, 1]) <= np.abs(view[:, 1]).max(initial=0.0)
    return (near <= sightings[:, 0]) & (sightings[:, 0] <= far) & ahead


def _first(t: Array, row: Ints, landmarks: int) -> Array:
    """(landmarks,) the time of the first of the sightings at `t` (s,) of each landmark."""
    first = np.full(landmarks, np.inf)
    np.minimum.at(first, row, t)
    return first


def _folded(way: Array, roaming: float) -> Array:
    """The end of a way along a line that turns back at `roaming` m on either side."""
    return roaming - np.abs(np.mod(way + roaming, 4 * roaming) - 2 * roaming)
