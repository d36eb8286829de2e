"""The linear Kalman filter of the survey slides: SLAM linearised at the odometry's heading.

The slides' algorithm Kalman_filter, lines 2-8: x_t = A x_{t-1} + B u_t + noise of covariance R, z_t = H x_t + noise of
covariance Q, where A, B and H may change with time but must not depend on the state. The state is (x, y, heading, m1x,
m1y, ...). The models become linear by taking the heading as given, as by a compass: h, the prior's heading plus the sum
of the odometry's turns. It rotates motions and sightings, and their covariances, into the world; a sighting (range,
bearing) becomes an offset in metres there, the middle of the arc of possible positions. With w = Rot(h) (dx, dy) for
the motion, or for the sighted offset, and w' the same turned left by a right angle,

    x, y   +=  w + w' (heading - h)          w  =  m - (x, y) - w' (heading - h)

the terms with heading - h being the first-order effect of a heading error. The extended Kalman filter differs only in
rotating by its own estimate of the heading. Where dead reckoning knows the heading the two agree, and are optimal;
elsewhere the linear filter is linearised in the wrong place, and overconfident.
"""

import numpy as np

from ...core.factors import Prior, Step
from ...core.kernels._planar import wrap
from ..api import COMPILED_HERE, Belief, Builder, NoOptions, Pose
from .ekf import Ekf, Options


class Kf(Ekf):
    """The linear Kalman filter of the survey slides: unlike the EKF it treats dead reckoning's heading as known."""

    def __init__(self, prior: Prior, options: NoOptions, rng: np.random.Generator) -> None:
        del options
        super().__init__(prior._replace(loops=False), Options(jacobians="odometry"), rng)

    def step(self, step: Step) -> Pose:
        """As the EKF's; the state's heading is wrapped only here."""
        pose = super().step(step)
        pose[2] = wrap(pose[2])
        return pose

    def belief(self) -> Belief:
        """As the EKF's."""
        belief = super().belief()
        belief.pose[2] = wrap(belief.pose[2])
        return belief


build = Builder(Kf, linear=True, implementation=COMPILED_HERE)
