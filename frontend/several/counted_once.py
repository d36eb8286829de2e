"""Refuses odometry that is made of the laser's own scans: beside the motions that these tell it would count them twice.

Wheels cannot know where the scans err. Odometry that differs from the scans' motions by far less than the scans' own
noise was made by matching them, as by a scan matcher whose topic is taken for the wheels'.
"""

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, between, wrap
from ...core.small_matrices import inverse
from ..wheels.motion import Drift, Motion
from .scan_motions import Motions
from .wheels_path import walked

SAME = 0.2
"""Of the noise that the scans' motions state, by which the odometry differs from them, in the median."""

FEW = 10  # motions that tell anything


def check_counted_once(name: str, motion: Motion, motions: Motions, t: Array) -> None:
    """Raises InputError for the recording `name` where its odometry is made of its scans, taken at `t` (k,), s."""
    if isinstance(motion, Drift) or len(motions.at) < FEW:
        return
    path = walked(motion, t)
    off = motions.delta - between(path[motions.to], path[motions.at])
    off[:, 2] = wrap(off[:, 2])
    squares = np.einsum("ni,nij,nj->n", off, inverse(motions.cov), off) / 3
    share = float(np.sqrt(np.median(squares)))
    if share < SAME:
        raise InputError(
            f"{name}: motions by {motion.readings} differ from those that the scans tell by {share:.2g} of the scans' "
            f"own noise (median), expected more than {SAME:g}: they are made of these scans, which would count twice; "
            "expected those of wheels, or one sensor alone."
        )
