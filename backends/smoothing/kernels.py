"""The inner loops of a smoother, each with arguments of its types, for parallel compilation."""

import numpy as np

from ...core.kernels.compile_ahead import Kernels
from . import _cost, _covariances, _front, _log, _offsets, _opening, _ordering, _relinearise, _step, _tree
from .arrays import made


def kernels() -> Kernels:
    """Kernels in order of first use; those that share most are adjacent."""
    g = made(0, 0.0)
    ints, numbers, table, tables = np.zeros(1, np.int64), np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1, 1))
    return [
        (_step.plain_step, (g.address, 0, 0, table, ints, table, numbers, table)),
        (_step.parts_step, (g.address, 0, 0, table, ints, table, ints, ints, table, numbers, table)),
        (_step.root_offset, (g.address,)),
        (_log.move, (g, table, numbers, table)),
        (_log.add_pose_after, (g, 0, 0)),
        (_log.add_sightings_of, (g, 0, ints, table)),
        (_log.add_parts_of, (g, 0, ints, ints, table)),
        (_log.add_variable, (g, 0, 0.0, 0.0, 0.0)),
        (_log.add_loop, (g, 0, 0, numbers, table)),
        (_log.split, (g, 0)),
        (_tree.enter, (g, 0)),
        (_tree.advance, (g, 0)),
        (_front.solve, (g, numbers, table)),
        (_tree.rebuild, (g, 0, ints, ints, ints, 0, ints, True)),
        (_relinearise.recentre, (g,)),
        (_relinearise.settle, (g, ints, table, table)),
        (_opening.about, (g, 0, 0.0, 0, ints)),
        (_opening.sighted, (g, 0)),
        (_offsets.top_down, (g,)),
        (_offsets.offsets, (g, ints, table)),
        (_offsets.predicted_fall, (g, ints)),
        (_offsets.candidate, (g, table, table, 0.0, 0.0, table, table)),
        (_cost.cost, (g, table, table)),
        (_ordering.plan, (g, 0, ints, ints, True, True)),
        (_offsets.inner_offsets, (g, table, 0.0, table)),
        (_covariances.pose_covariances, (g, ints, 0, tables)),
    ]
