"""The arrays of a joint Gaussian belief, for compiled code to receive by one address."""

from ...core.kernels._arrays import Arrays, Integers, Numbers, Table, at


class JointArrays(Arrays):
    """Those of `Joint`, which has their meanings."""

    mean: Numbers
    points: Numbers
    pose: Table
    cross: Table
    flat: Numbers
    agreed: Integers
    bound: Numbers


belief_at = at(JointArrays)
"""The belief at an address."""
