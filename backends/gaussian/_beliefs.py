"""The arrays of the filters' beliefs and of a step, for compiled code to receive by one address."""

from ...core.kernels._arrays import Arrays, Integers, Numbers, Table, at


class JointArrays(Arrays):
    """Those of `Joint`, which has their meanings."""

    mean: Numbers
    points: Numbers
    predicted: Numbers
    pose: Table
    cross: Table
    flat: Numbers
    agreed: Integers
    bound: Numbers
    transition: Table
    information: Table
    pull: Numbers
    owed_pose: Table
    owed_map: Table
    owed_transition: Table
    blas: Integers  # (2,) addresses of dgemm and dsyrk


class Frame(Arrays):
    """The measurements of a step."""

    motion: Table  # (4, 3) dx, dy, dtheta and their covariance
    truth: Numbers  # (3,) the true pose, for ideal Jacobians
    slots: Integers  # (k,) the landmarks' indices
    z: Table  # (k, 2)
    cov: Table  # (k, 4) of z: rr, rb, br, bb


belief_at = at(JointArrays)
"""The joint belief at an address."""

frame_at = at(Frame)
"""The frame at an address."""
