"""The arrays of expected sightings, for compiled code to receive by one address."""

from ..core.kernels._arrays import Arrays, Integers, Numbers, Table, at


class ExpectedArrays(Arrays):
    """`Expected`, of n landmarks that come first in arrays with room for c; and what it is for.

    Who fills it calls `_rules.conclude` at the end: one compiled call asks a backend and decides.
    """

    count: Integers  # (1,) n
    ids: Integers  # (c,)
    z: Table  # (c, 2) range (m), bearing (rad)
    cov: Numbers  # (4c^2,) of which the first 4n^2 are (2n, 2n)
    decision: Integers  # (1,) the address of the `Decision` to be made by it, or 0


expected_at = at(ExpectedArrays)
"""The expected sightings at an address."""
