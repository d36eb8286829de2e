"""A gyro's bias in particles over the path: Gaussian in each of them, given its path (Rao-Blackwellised).

With u ~ N(delta, Q) the motion by the wheels, b ~ N(b_m, P) the bias of particle m, and a turn of variance var over dt,
the turn is one of variance var + P dt^2 to that particle, and `core.gyro.conditioned` gives its motion

    u ~ N(delta + K (turn - delta_t - b_m dt), Q - K Q_t'),    K = Q_t / (Q_tt + var + P dt^2)

from which the pose is drawn, alone or with sightings; the particle is as likely as the turn was to it. The heading step
that was drawn then tells the bias: turn - step = b dt + noise of variance var. P is the same in all particles.
"""

import numpy as np

from ...core.factors import Odometry
from ...core.gyro import Bias, Turn, conditioned
from ...core.se2 import Array, Ints, wrap
from ._particles import move


class GyroBias:
    """The bias in each of M particles."""

    def __init__(self, prior: Bias, particles: int) -> None:
        self.mean, self.var = np.full(particles, prior.mean), prior.sd**2
        self._turn: Turn | None = None  # of the step that is drawn now
        self._before = np.zeros(particles)  # headings

    def resampled(self, ancestors: Ints) -> None:
        """Replaces each particle m by a copy of particle ancestors[m]."""
        self.mean = self.mean[ancestors]

    def turned(self, poses: Array, motion: Odometry, turn: Turn) -> tuple[Odometry, Array]:
        """The motion by wheels and gyro from `poses` (5, M), and what the turn says against each particle (M,).

        The motion of each is its own, and all have one: the poses get the rest of theirs first. Their cosine and sine,
        which turn the motion into the world, stay those of the heading before.
        """
        self._turn, self._before = turn, poses[2].copy()
        self.var += turn.walk
        return _apart(poses, motion, turn, self.mean, self.var)

    def ahead(self, poses: Array, motion: Odometry, turn: Turn) -> tuple[Array, Array, Array]:
        """The poses (5, M) after a motion's mean, (M,) as `turned`, and the motion's covariance in its body frame."""
        after = poses.copy()
        moved, surprise = _apart(after, motion, turn, self.mean, self.var + turn.walk)
        move(after, moved.delta, np.eye(3), np.zeros((3, poses.shape[1])))
        return after, surprise, moved.cov

    def learn(self, poses: Array) -> None:
        """Corrects the bias by the heading step that was drawn, to poses (5, M)."""
        if self._turn is None:
            return
        turn, var, dt, _ = self._turn
        gain = self.var * dt / (self.var * dt**2 + var)
        self.mean = self.mean + gain * wrap(turn - (poses[2] - self._before) - self.mean * dt)
        self.var *= 1 - gain * dt
        self._turn = None

    def marginal(self, weights: Array) -> Bias:
        """Mean and standard deviation by all particles."""
        mean = float(self.mean @ weights)
        return Bias(mean, float(np.sqrt(self.var + (self.mean - mean) ** 2 @ weights)))


def _apart(poses: Array, motion: Odometry, turn: Turn, bias: Array, var: float) -> tuple[Odometry, Array]:
    """See `GyroBias.turned`; `bias` (M,) of variance `var` is that of the turn."""
    noise = turn.var + var * turn.dt**2
    rows = (np.array([one]) for one in (turn.turn, noise, turn.dt))
    (delta,), (cov,), (slope,), (told,), (told_var,) = conditioned(motion.delta[None], motion.cov[None], *rows)
    ahead, left, turning = slope[:, None] * bias
    cos, sin = poses[3], poses[4]
    poses[0] += cos * ahead - sin * left
    poses[1] += sin * ahead + cos * left
    poses[2] += turning
    return Odometry(delta.copy(), cov.copy()), wrap(told - bias * turn.dt) ** 2 / told_var
