"""Wheels that slip on a share of the way in a simulated world, as an option of the dataset.

It is an error of the odometry that its stated noise does not cover. It is drawn from a generator of its own: everything
else of the log is the same, bit for bit, and a larger share includes the slips of a smaller one.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...core.arrays import frozen
from ...core.elementary import hypot
from ...core.factors import Dataset
from ...core.options import option
from ...core.se2 import wrap
from ...frontend.wheels.encoder import roll

SLIP_NOTE = "steps on which a wheel slips"  # the key of their number, among the log's notes

STRETCH = 0.5  # m of the way on which one wheel slips, or none
SPINS = 0.2  # share of its way by which that wheel reads more, as it spins, or less, as it skids
TRACK = 0.5  # m between the wheels


@dataclass(frozen=True)
class WorldSlip:
    """Wheels that slip, by default never; a simulated world's options inherit it."""

    slip_share: float = option(
        0.0,
        "share of the way on which a wheel spins or skids by 20 %, beyond the stated noise",
        minimum=0.0,
        maximum=1.0,
    )


def with_slip(dataset: Dataset, options: WorldSlip, rng: np.random.Generator) -> Dataset:
    """Adds to the odometry what the slipping wheel reads too much or too little: half of that as way, and a turn.

    The motion follows from both as from a wheel's readings, along an arc.
    """
    log = dataset.log
    if not options.slip_share:
        return dataset
    way, turn = hypot(*log.delta[1:, :2].T), log.delta[1:, 2]
    stretch = np.floor(np.cumsum(way) / STRETCH).astype(np.int64)
    slipping, siding, spinning = rng.spawn(3)
    slips = slipping.uniform(size=stretch[-1] + 1) < options.slip_share
    side = np.where(siding.uniform(size=stretch[-1] + 1) < 0.5, -1.0, 1.0)
    spins = np.where(spinning.uniform(size=stretch[-1] + 1) < 0.5, -1.0, 1.0)
    more = (SPINS * slips * spins)[stretch] * way
    read = np.column_stack((way, turn)), np.column_stack((way + more / 2, turn + side[stretch] * more / TRACK))
    before, after = (roll(one, "arc")[0] for one in read)
    delta = log.delta.copy()
    ahead = np.where(delta[1:, :1] < 0, -1.0, 1.0)  # or backwards
    delta[1:, :2] += ahead * (after - before)[:, :2]
    delta[1:, 2] = wrap(after[:, 2])
    delta[1:][more == 0] = log.delta[1:][more == 0]
    notes = {**log.notes, SLIP_NOTE: int((more != 0).sum())}
    return dataset._replace(log=replace(log, delta=frozen(delta), notes=notes))
