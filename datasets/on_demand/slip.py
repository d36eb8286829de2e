"""Wheels that slip on a share of the way in a simulated world, as an option of the dataset.

It is an error of the odometry that its stated noise does not cover. It is drawn from a generator of its own: everything
else of the log is the same, bit for bit, and a larger share includes the slips of a smaller one.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import frozen
from ...core.elementary import hypot
from ...core.factors import Dataset
from ...core.options import option
from ...core.se2 import Array, between, compose, wrap
from ...frontend.wheels.encoder import roll

SLIP_NOTE = "steps on which a wheel slips"  # the key of their number, among the log's notes

STRETCH = 0.5  # m of the way on which one wheel slips, or none
SPINS = 0.2  # share of its way by which that wheel reads more, as it spins, or less, as it skids
TRACK = 0.5  # m between the wheels


@dataclass(frozen=True)
class WheelSlip:
    """Wheels that slip, by default never; the options of a world that makes its wheels' readings inherit it."""

    slip_share: float = option(
        0.0,
        "share of the way on which a wheel spins or skids by 20 %, beyond the stated noise",
        minimum=0.0,
        maximum=1.0,
    )


@dataclass(frozen=True)
class WorldSlip(WheelSlip):
    """The same for a simulated world whose log has the wheels' motions as they are: they slip in the log."""


def with_slip(dataset: Dataset, options: WorldSlip, rng: np.random.Generator) -> Dataset:
    """Lets the wheels of a log slip."""
    log = dataset.log
    if not options.slip_share:
        return dataset
    delta = log.delta.copy()
    delta[1:], slips = _slipped(log.delta[1:], options.slip_share, rng)
    notes = {**log.notes, SLIP_NOTE: int(slips.sum())}
    return dataset._replace(log=replace(log, delta=frozen(delta), notes=notes))


def slipping_poses(poses: Array, options: WheelSlip, rng: np.random.Generator) -> Array:
    """Odometry's poses (n, 3) by wheels that slip."""
    if not options.slip_share:
        return poses
    motions, _ = _slipped(between(poses[:-1], poses[1:]), options.slip_share, rng)
    out = [poses[0]]
    for motion in motions:
        out.append(compose(out[-1], motion))
    return np.array(out)


def _slipped(motion: Array, share: float, rng: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
    """Adds to motions (n, 3) what the slipping wheel reads too much or too little: half of that as way, and a turn.

    The motion follows from both as from a wheel's readings, along an arc. Where no wheel slips, (n,), it stays.
    """
    way, turn = hypot(*motion[:, :2].T), motion[:, 2]
    stretch = np.floor(np.cumsum(way) / STRETCH).astype(np.int64)
    slipping, siding, spinning = rng.spawn(3)
    slips = slipping.uniform(size=stretch[-1] + 1) < share
    side = np.where(siding.uniform(size=stretch[-1] + 1) < 0.5, -1.0, 1.0)
    spins = np.where(spinning.uniform(size=stretch[-1] + 1) < 0.5, -1.0, 1.0)
    more = (SPINS * slips * spins)[stretch] * way
    read = np.column_stack((way, turn)), np.column_stack((way + more / 2, turn + side[stretch] * more / TRACK))
    before, after = (roll(one, "arc")[0] for one in read)
    slipped = motion.copy()
    ahead = np.where(motion[:, :1] < 0, -1.0, 1.0)  # or backwards
    slipped[:, :2] += ahead * (after - before)[:, :2]
    slipped[:, 2] = wrap(after[:, 2])
    still: NDArray[np.bool_] = more == 0
    slipped[still] = motion[still]
    return slipped, ~still
