"""Inner loop: the filter of the direction of gravity, of the gyro's bias and of the robot's acceleration."""

import numpy as np

from ...core.kernels._small import inverse, rodrigues
from ...core.kernels.compiled import compiled
from ...core.se2 import Array

G = 9.80665  # m/s^2


@compiled
def follow_gravity(
    dt: Array,
    gyro: Array,
    accel: Array,
    used: Array,
    turned: Array,
    settings: Array,
    starts: Array,
    bias: Array,
    up: Array,
    cov: Array,
) -> float:
    """Writes the direction up (n, 3) in the robot's frame and its covariance (n, 3, 3); returns the log likelihood.

    The state (9,) is the direction, the bias of the gyro and the acceleration of the robot, which is of first order, as
    in Luinge and Veltink (2005). `dt` (n,) s are the times since the reading before, `gyro` (n, 3) the mean rates
    meanwhile, `turned` (n,) rad^2/s how unsure they are, `used` (n,) 1 where `accel` (n, 3) counts. It begins with the
    direction of `starts` (n, 3), at the first reading and wherever else that is not zero: of what was before it keeps
    the bias alone. `bias` (6,) is the first one of the gyro and its standard deviations.
    `settings`: the accelerometer's variance, (m/s^2)^2, the acceleration's standard deviation and time constant, the
    drift of the bias, (rad/s)^2/s, and the variance of a direction where it begins.
    """
    variance, push, lasting, drift, first = settings[0], settings[1], settings[2], settings[3], settings[4]
    x, P = np.zeros(9), np.zeros((9, 9))
    E, B, turn, miss, u = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3)
    S, W, PH, gain = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((9, 3)), np.zeros((9, 3))
    for i in range(3):
        x[3 + i], P[3 + i, 3 + i] = bias[i], bias[3 + i] ** 2
    total = 0.0
    for k in range(len(dt)):
        h = dt[k]
        if starts[k, 0] != 0.0 or starts[k, 1] != 0.0 or starts[k, 2] != 0.0:
            _begin(x, P, starts[k], first, push**2, drift * h)
        elif h > 0.0:
            for i in range(3):
                turn[i] = (x[3 + i] - gyro[k, i]) * h  # the world turns the other way
            rodrigues(turn, E)
            for i in range(3):
                u[i] = E[i, 0] * x[0] + E[i, 1] * x[1] + E[i, 2] * x[2]
            B[0, 1], B[0, 2] = u[2] * h, -u[1] * h  # the derivative of u x (w - b) by b is -[u]x
            B[1, 0], B[1, 2] = -u[2] * h, u[0] * h
            B[2, 0], B[2, 1] = u[1] * h, -u[0] * h
            decay = np.exp(-h / lasting)
            _rows(P, E, B, decay)
            _transpose(P)
            _rows(P, E, B, decay)
            for i in range(3):
                for j in range(3):
                    P[i, j] += turned[k] * h * ((1.0 if i == j else 0.0) - u[i] * u[j])
                P[3 + i, 3 + i] += drift * h
                P[6 + i, 6 + i] += push**2 * (1.0 - decay * decay)
                x[i], x[6 + i] = u[i], decay * x[6 + i]
        if used[k] > 0.0:
            for i in range(9):
                for j in range(3):
                    PH[i, j] = G * P[i, j] + P[i, 6 + j]
            for i in range(3):
                for j in range(3):
                    S[i, j] = G * PH[i, j] + PH[6 + i, j] + (variance if i == j else 0.0)
                miss[i] = accel[k, i] - G * x[i] - x[6 + i]
            inverse(S, W)
            chi2 = 0.0
            for i in range(3):
                for j in range(3):
                    chi2 += miss[i] * W[i, j] * miss[j]
            minor = S[1, 1] * S[2, 2] - S[1, 2] * S[2, 1], S[1, 0] * S[2, 2] - S[1, 2] * S[2, 0]
            last = S[1, 0] * S[2, 1] - S[1, 1] * S[2, 0]
            total -= 0.5 * (chi2 + np.log(S[0, 0] * minor[0] - S[0, 1] * minor[1] + S[0, 2] * last))
            for i in range(9):
                for j in range(3):
                    gain[i, j] = PH[i, 0] * W[0, j] + PH[i, 1] * W[1, j] + PH[i, 2] * W[2, j]
                x[i] += gain[i, 0] * miss[0] + gain[i, 1] * miss[1] + gain[i, 2] * miss[2]
            for i in range(9):
                for j in range(i + 1):
                    P[i, j] -= gain[i, 0] * PH[j, 0] + gain[i, 1] * PH[j, 1] + gain[i, 2] * PH[j, 2]
                    P[j, i] = P[i, j]
            size = np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
            for i in range(3):
                x[i] /= size
                u[i] = x[i]
            _without(P, u)
            _transpose(P)
            _without(P, u)
        for i in range(3):
            up[k, i] = x[i]
            for j in range(3):
                cov[k, i, j] = P[i, j]
    return total


@compiled
def _begin(x: Array, P: Array, start: Array, first: float, push: float, drift: float) -> None:
    """Sets the direction to `start` (3,), with the variance `first`, and the acceleration to none, with `push`.

    The bias has moved by the variance `drift`.
    """
    for i in range(3):
        x[i], x[6 + i] = start[i], 0.0
        for j in range(9):
            P[i, j] = P[j, i] = P[6 + i, j] = P[j, 6 + i] = 0.0
    for i in range(3):
        for j in range(3):
            P[i, j] = first * ((1.0 if i == j else 0.0) - start[i] * start[j])
        P[3 + i, 3 + i] += drift
        P[6 + i, 6 + i] = push


@compiled
def _rows(P: Array, E: Array, B: Array, decay: float) -> None:
    """P (9, 9) becomes F P, where the rows of F are E and B, those of the bias, and `decay` for the acceleration."""
    for j in range(9):
        a, b, c = P[0, j], P[1, j], P[2, j]
        for i in range(3):
            turned = E[i, 0] * a + E[i, 1] * b + E[i, 2] * c
            P[i, j] = turned + B[i, 0] * P[3, j] + B[i, 1] * P[4, j] + B[i, 2] * P[5, j]
            P[6 + i, j] *= decay


@compiled
def _without(P: Array, u: Array) -> None:
    """Takes the part along `u` (3,) off the first three rows of P (9, 9): the direction keeps its length."""
    for j in range(9):
        along = u[0] * P[0, j] + u[1] * P[1, j] + u[2] * P[2, j]
        for i in range(3):
            P[i, j] -= u[i] * along


@compiled
def _transpose(P: Array) -> None:
    for i in range(9):
        for j in range(i):
            P[i, j], P[j, i] = P[j, i], P[i, j]
