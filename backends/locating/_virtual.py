"""Places of sightings in the frame of an earlier pose, and their joint covariance.

With the motions d_l, the pose c_l after motion l and the place p_i of a sighting made after motion b, an error w_l of
motion l, rotated to the frame, moves the place by

    [I | J p_i] A_l w_l,  A_l = [I, -J c_l; 0, 1],  J = [0 -1; 1 0]

as it shifts all that comes later and turns it about c_l. So the covariance of two places seen after motions a <= b is
H_i S_a H_j' with H_i = [I | J p_i] and S_a = sum over l <= a of A_l Q_l A_l': one 3x3 matrix for each pose.
"""

from math import cos, sin

import numpy as np

from ...core.kernels._planar import rotated
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints


@compiled
def chain(delta: Array, delta_cov: Array, poses: Array, sums: Array) -> None:
    """Adds up the motions (n, 3) of covariances (n, 3, 3), row 0 unused, into poses (n, 3) and their S (n, 3, 3)."""
    poses[0] = 0.0
    sums[0] = 0.0
    A, AQ = np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(1, len(delta)):
        c, s = cos(poses[k - 1, 2]), sin(poses[k - 1, 2])
        x = poses[k - 1, 0] + c * delta[k, 0] - s * delta[k, 1]
        y = poses[k - 1, 1] + s * delta[k, 0] + c * delta[k, 1]
        poses[k, 0], poses[k, 1], poses[k, 2] = x, y, poses[k - 1, 2] + delta[k, 2]
        A[0, 0], A[0, 1], A[0, 2] = c, -s, y
        A[1, 0], A[1, 1], A[1, 2] = s, c, -x
        A[2, 2] = 1.0
        for i in range(3):
            for j in range(3):
                AQ[i, j] = A[i, 0] * delta_cov[k, 0, j] + A[i, 1] * delta_cov[k, 1, j] + A[i, 2] * delta_cov[k, 2, j]
        for i in range(3):
            for j in range(3):
                sums[k, i, j] = sums[k - 1, i, j] + AQ[i, 0] * A[j, 0] + AQ[i, 1] * A[j, 1] + AQ[i, 2] * A[j, 2]


@compiled
def place(poses: Array, sums: Array, step: Ints, z: Array, z_cov: Array, xy: Array, cov: Array) -> None:
    """Computes the places `xy` (k, 2) of the sightings `z` (k, 2) at `step` (k,), ascending, and `cov` (2k, 2k)."""
    for i in range(len(step)):
        pose = poses[step[i]]
        c, s, r = cos(pose[2] + z[i, 1]), sin(pose[2] + z[i, 1]), z[i, 0]
        xy[i, 0], xy[i, 1] = pose[0] + r * c, pose[1] + r * s
        rr, rb, bb = z_cov[i, 0, 0], r * z_cov[i, 0, 1], r * r * z_cov[i, 1, 1]
        for j in range(i + 1):
            S = sums[step[j]]
            x, y, u, v = xy[i, 0], xy[i, 1], xy[j, 0], xy[j, 1]
            cov[2 * i, 2 * j] = S[0, 0] - y * S[2, 0] - v * S[0, 2] + y * v * S[2, 2]
            cov[2 * i, 2 * j + 1] = S[0, 1] - y * S[2, 1] + u * S[0, 2] - y * u * S[2, 2]
            cov[2 * i + 1, 2 * j] = S[1, 0] + x * S[2, 0] - v * S[1, 2] - x * v * S[2, 2]
            cov[2 * i + 1, 2 * j + 1] = S[1, 1] + x * S[2, 1] + u * S[1, 2] + x * u * S[2, 2]
        xx, xy_, yy = rotated(c, s, rr, rb, bb)
        cov[2 * i, 2 * i] += xx
        cov[2 * i, 2 * i + 1] += xy_
        cov[2 * i + 1, 2 * i] = cov[2 * i, 2 * i + 1]
        cov[2 * i + 1, 2 * i + 1] += yy
        for j in range(i):
            for g in range(2):
                for h in range(2):
                    cov[2 * j + h, 2 * i + g] = cov[2 * i + g, 2 * j + h]
