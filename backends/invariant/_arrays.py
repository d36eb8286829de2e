"""The arrays of the invariant filter's belief, for compiled code to receive by one address."""

from ...core.kernels._arrays import Arrays, Integers, Numbers, Table, at


class GroupArrays(Arrays):
    """Those of the invariant filter: see `_invariant`."""

    pose: Numbers
    mean: Numbers
    strip: Table
    flat: Numbers
    owed: Table
    owing: Integers
    known: Table  # (., 2) landmarks held fixed, m from the origin
    origin: Numbers  # (2,) m, in the world
    blas: Integers  # (2,) addresses of dgemm and dsyrk


group_at = at(GroupArrays)
"""The invariant filter's belief at an address."""
