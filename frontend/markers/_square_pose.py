"""Inner loop of `square_pose`: Levenberg-Marquardt over a square's pose, compiled."""

from typing import Any

import numpy as np

from ...core.kernels._small import dot, rodrigues
from ...core.kernels.compiled import compiled
from ...core.se2 import Array

SAME = 1e-3
"""Rotations that differ by less in every element count as equal."""

ROUNDS = 30
"""Most Levenberg-Marquardt steps; a handful suffices unless the square is tiny."""


@compiled
def explain(outline: Array, rays: Array, cov: Array, turns: Array, shifts: Array) -> tuple[Array, Array, Array]:
    """Refines n starts, rotation vectors and shifts (n, 3).

    Returns poses (k, 4, 4), their covariances (k, 6, 6), of place and turn, and chi-squares (k,), of those that differ,
    likeliest first: a start may lead to no square in front of the camera and facing it. LinAlgError for a singular
    `cov`.
    """
    count = len(turns)
    poses, spreads, squares = np.zeros((count, 4, 4)), np.zeros((count, 6, 6)), np.full(count, np.inf)
    weight: Any = np.linalg.inv(cov)
    for k in range(count):
        start = np.empty((3, 3))
        rodrigues(turns[k], start)
        if not (np.isfinite(start).all() and np.isfinite(shifts[k]).all()):
            continue
        rotation, shift, information, chi2 = _settled(outline, rays, weight, start, shifts[k].copy())
        facing = rotation[0, 2] * shift[0] + rotation[1, 2] * shift[1] + rotation[2, 2] * shift[2] < 0
        for corner in outline:
            facing = facing and rotation[2, 0] * corner[0] + rotation[2, 1] * corner[1] + shift[2] > 0
        if not (facing and abs(np.linalg.det(information)) > 0):
            continue
        inverse = np.linalg.inv(information)
        for i in range(3):
            for j in range(3):
                poses[k, i, j] = rotation[i, j]
            poses[k, i, 3] = shift[i]
        for i in range(6):
            for j in range(6):
                row, column = (i + 3) % 6, (j + 3) % 6  # the turn is first in `information`
                spreads[k, i, j] = 0.5 * (inverse[row, column] + inverse[column, row])
        poses[k, 3, 3] = 1.0
        squares[k] = chi2
    kept = 0
    order = np.argsort(squares)
    for k in order:
        # A large square has one best pose, to which both starts converge.
        twice = False
        for other in order[:kept]:
            twice = twice or np.abs(poses[other, :3, :3] - poses[k, :3, :3]).max() < SAME
        if squares[k] < np.inf and not twice:
            order[kept] = k
            kept += 1
    order = order[:kept]
    return poses[order], spreads[order], squares[order]


@compiled
def _settled(
    outline: Array, rays: Array, weight: Array, rotation: Array, shift: Array
) -> tuple[Array, Array, Array, float]:
    """Levenberg-Marquardt: returns the pose, its (6, 6) information in (turn, shift), and chi-square."""
    misses = np.zeros(8)
    jacobian = np.zeros((8, 6))
    trial_misses = np.zeros(8)
    trial_jacobian = np.zeros((8, 6))
    information = np.zeros((6, 6))
    turned = np.empty((3, 3))
    if not _misses(outline, rays, rotation, shift, misses, jacobian):
        return rotation, shift, information, np.inf
    chi2 = dot(misses, weight @ misses)
    damping = 1e-6
    for _ in range(ROUNDS):
        information = jacobian.T @ (weight @ jacobian)
        gradient = jacobian.T @ (weight @ misses)
        damped = information.copy()
        for k in range(6):
            damped[k, k] += damping * information[k, k] + 1e-12
        step: Any = np.linalg.solve(damped, gradient)
        rodrigues(step[:3], turned)
        trial_rotation = turned @ rotation
        trial_shift = shift + step[3:]
        better = False
        if _misses(outline, rays, trial_rotation, trial_shift, trial_misses, trial_jacobian):
            trial = dot(trial_misses, weight @ trial_misses)
            if trial <= chi2:
                better = True
                done = chi2 - trial <= 1e-9 * chi2 + 1e-9
                rotation, shift, chi2 = trial_rotation, trial_shift, trial
                _copy(trial_misses, trial_jacobian, misses, jacobian)
                damping = max(damping * 0.1, 1e-12)
                if done:
                    break
        if not better:
            damping = max(damping * 10.0, 1e-6)
            if damping > 1e8:
                break
    return rotation, shift, jacobian.T @ (weight @ jacobian), chi2


@compiled
def _misses(outline: Array, rays: Array, rotation: Array, shift: Array, misses: Array, jacobian: Array) -> bool:
    """Residuals (8,) of the corners, seen minus expected, and d expected / d (turn, shift), (8, 6).

    The turn is a small rotation about the camera's axes, after the rotation. False: behind the camera.
    """
    for k in range(4):
        a = rotation[0, 0] * outline[k, 0] + rotation[0, 1] * outline[k, 1]
        b = rotation[1, 0] * outline[k, 0] + rotation[1, 1] * outline[k, 1]
        c = rotation[2, 0] * outline[k, 0] + rotation[2, 1] * outline[k, 1]
        z = c + shift[2]
        if not z > 1e-9:
            return False
        x = (a + shift[0]) / z
        y = (b + shift[1]) / z
        misses[2 * k] = rays[k, 0] - x
        misses[2 * k + 1] = rays[k, 1] - y
        # d (X, Y, Z) / d turn = -[a b c]x, and of x = X / Z: (dX - x dZ) / Z
        jacobian[2 * k, 0] = -x * b / z
        jacobian[2 * k, 1] = (c + x * a) / z
        jacobian[2 * k, 2] = -b / z
        jacobian[2 * k, 3] = 1 / z
        jacobian[2 * k, 4] = 0.0
        jacobian[2 * k, 5] = -x / z
        jacobian[2 * k + 1, 0] = (-c - y * b) / z
        jacobian[2 * k + 1, 1] = y * a / z
        jacobian[2 * k + 1, 2] = a / z
        jacobian[2 * k + 1, 3] = 0.0
        jacobian[2 * k + 1, 4] = 1 / z
        jacobian[2 * k + 1, 5] = -y / z
    return True


@compiled
def _copy(misses: Array, jacobian: Array, other_misses: Array, other_jacobian: Array) -> None:
    """Copies entry by entry: whole-array assignments take seconds to compile, for their error checks."""
    for i in range(8):
        other_misses[i] = misses[i]
        for j in range(6):
            other_jacobian[i, j] = jacobian[i, j]
