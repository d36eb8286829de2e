"""Drives of the rendered room with a scanner, whose sightings are simulated, not rendered."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slamduel.core.factors import Log
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.aruco_room import MATCHING, Options, recorded
from slamduel.datasets.worlds.measurements import in_reach, sightings
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import drive
from slamduel.frontend.laser.front_end import FrontEnd
from slamduel.frontend.laser.log import log_of
from slamduel.frontend.laser.recording import matched
from slamduel.frontend.several.log import Scanned, Several, joined
from slamduel.frontend.several.scan_motions import Motions, scan_motions

NOISE = 0.03  # m, of a marker's place along and across the line of sight


class Driven(NamedTuple):
    """A drive."""

    several: Several
    seen: Log  # of the markers alone
    alone: Log  # of the laser alone
    front_end: FrontEnd
    motions: Motions
    log: Log  # of both


def true_poses(t: Array) -> Array:
    """The poses (n, 3) of the drive at `t` (n,), s."""
    return drive(LOOP, Options().speed, t)[0]


@cache
def driven(seed: int, seconds: float = 30.0) -> Driven:
    """The drive of `seed`, with a frame a second."""
    options = Options(seconds=seconds, frame_rate=1.0, scan_rate=5.0)
    recording, truth, scans, *_ = recorded(options, generator("aruco-room", seed))
    assert scans is not None
    assert truth.map is not None
    t = np.arange(options.frames) / options.frame_rate
    step, row = in_reach(true_poses(t), truth.map.xy, 0.3, 2.5)
    z, cov = sightings(true_poses(t)[step], truth.map.xy[row], NOISE, np.random.default_rng(seed))
    moved = [recording.motion.odometry(*ends) for ends in zip(t[:-1].tolist(), t[1:].tolist(), strict=True)]
    delta = np.concatenate((np.full((1, 3), np.nan), [one.delta for one in moved]))
    delta_cov = np.concatenate((np.full((1, 3, 3), np.nan), [one.cov for one in moved]))
    seen = Log.from_arrays(recording.name, recording.prior, t, delta, delta_cov, step, truth.map.ids[row], z, cov)
    several = Several(recording, scans, MATCHING)
    front_end = matched(scans, MATCHING)
    alone, motions = log_of(scans, front_end), scan_motions(front_end)
    return Driven(
        several, seen, alone, front_end, motions, joined(several, seen, Scanned(scans, alone, front_end, motions)).log
    )


def squares(delta: Array, cov: Array, true: Array) -> NDArray[np.float64]:
    """(m,) normalised squared errors of motions (m, 3), 1 in the mean where covariances are right."""
    off = delta - true
    off[:, 2] = wrap(off[:, 2])
    return np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off) / 3
