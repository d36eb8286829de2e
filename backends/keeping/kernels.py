"""The inner loops of this room, each with arguments of its types, for parallel compilation."""

import numpy as np

from ...core.kernels.compile_ahead import Kernels
from ..smoothing.arrays import made
from . import _condensed, _following, _gradients, _located, _rehung, _stretches


def kernels() -> Kernels:
    """Kernels in order of first use."""
    g = made(0, 0.0)
    some = np.zeros(1, np.bool)
    ints, numbers, table, tables = np.zeros(1, np.int64), np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1, 1))
    return [
        (_condensed.condense, (g, 0, 0, ints, True, True, table, numbers, tables)),
        (_located.own_covariances, (g, ints, True, tables, ints)),
        (_stretches.nearest, (0.0, 0.0, table)),
        (_stretches.stretches, (g, 0, 0, 0.0, 0, table, True)),
        (_stretches.seen_in, (g, 0, 0)),
        (_rehung.rehang, (g,)),
        (_following.follow, (table, table, table, table, ints, ints, ints, 0.0)),
        (_following.with_frames, (table, table, table, tables, ints, tables)),
        (_gradients.linearise, (table, ints, ints, table, 0, numbers, table, table, table)),
        (_gradients.chain, (ints, ints, table, table, some, tables, tables)),
        (_gradients.pulled, (ints, ints, table, table, table, some, table)),
        (_gradients.drawn, (ints, ints, table, table, some, table, table)),
        (_gradients.offsets, (ints, ints, table, table, some, tables, tables, table, 0.0, table)),
        (_gradients.add_squares, (table, tables)),
    ]
