"""Sightings of several steps as places in one frame, that of the first step's pose."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Odometry, Step
from ...core.se2 import Array, Ints, inverse
from ._virtual import chain, place


class Virtual(NamedTuple):
    """The places of k sightings in the frame of the first step's pose."""

    ids: Ints  # (k,) as sighted
    step: Ints  # (k,) index among the steps, ascending
    xy: Array  # (k, 2) m
    cov: Array  # (2k, 2k) joint: the sensor's noise, and the odometry's, which later places have in common


def virtual(steps: Sequence[Step], doubt: float = 1.0) -> Virtual:
    """Places the sightings of `steps` by the odometry between them; that of the first step is ignored.

    To first order in the noise, as an EKF. The odometry's covariances are multiplied by `doubt`. A later step without
    odometry counts as standing still.
    """
    delta, delta_cov = np.zeros((len(steps), 3)), np.zeros((len(steps), 3, 3))
    for k, step in enumerate(steps[1:], start=1):
        if step.odometry is not None:
            delta[k], delta_cov[k] = step.odometry
    delta_cov *= doubt
    seen = [step.sightings for step in steps]
    ids = np.concatenate([one.ids for one in seen])
    z = np.concatenate([one.z for one in seen])
    z_cov = np.concatenate([one.cov for one in seen])
    at = np.repeat(np.arange(len(steps)), [len(one.ids) for one in seen])
    poses, sums = np.empty((len(steps), 3)), np.empty((len(steps), 3, 3))
    chain(delta, delta_cov, poses, sums)
    xy, cov = np.empty((len(ids), 2)), np.empty((2 * len(ids), 2 * len(ids)))
    place(poses, sums, at, z, z_cov, xy, cov)
    return Virtual(ids, at, xy, cov)


def backward(steps: Sequence[Step]) -> list[Step]:
    """Returns the steps of a robot that drives the same way back, the last one first."""
    motions = [None, *(None if step.odometry is None else _inverse(step.odometry) for step in reversed(steps[1:]))]
    return [step._replace(odometry=motion) for step, motion in zip(reversed(steps), motions, strict=True)]


def _inverse(motion: Odometry) -> Odometry:
    """The motion back, with its covariance."""
    back = inverse(motion.delta)
    c, s = np.cos(motion.delta[2]), np.sin(motion.delta[2])
    by = np.array([[-c, -s, back[1]], [s, -c, -back[0]], [0.0, 0.0, -1.0]])
    return Odometry(back, by @ motion.cov @ by.T)
