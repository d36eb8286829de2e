"""EKF-SLAM with the slow errors of each landmark's sightings in the state.

Backends take the errors of sightings to be independent. Where a part of them stays for seconds, as ranges read off a
camera's picture do, a filter that takes each sighting as news becomes too sure of itself. Here that part is estimated:
a first-order Gauss-Markov process per landmark for its ranges, and one for its bearings (Bryson and Henrikson, Journal
of Spacecraft and Rockets 5(6), 1968, who call it the augmented filter). `bench noise` measures the shares and times.

Linearised as `invariant-ekf` is, which it equals where both shares are zero: with errors of sightings that may be slow,
information on the heading that no sighting gives would have more time to harm. The equations are in `_biased`, on a
covariance with all its elements: a sighting costs some 4 (3 + 4 n)^2 operations with n landmarks.
"""

from dataclasses import dataclass
from math import exp, log

import numpy as np

from ...core.factors import Map, Prior, Step
from ...core.options import option
from ...core.se2 import Ints
from .. import common_options
from ..api import COMPILED_HERE, Belief, Builder, Diverged, Pose, Solution
from ._biased import AT_ROBOT, EACH, BiasedArrays, frame

SPACE = 16  # landmarks that there is space for at first, doubled when exhausted

TIME = "time, s, in which that correlation falls to 1 / e"


@dataclass(frozen=True)
class Options:
    """The correlation of sightings, and the gate."""

    range_share: float = option(0.0, "share of the variance of ranges that is correlated", minimum=0.0, maximum=0.999)
    range_time: float = option(10.0, TIME, minimum=1e-3, maximum=1e6)
    bearing_share: float = option(
        0.0, "share of the variance of bearings that is correlated", minimum=0.0, maximum=0.999
    )
    bearing_time: float = option(10.0, TIME, minimum=1e-3, maximum=1e6)
    gate: float = common_options.gate()
    gate_after: int = common_options.gate_after()


class BiasEkf:
    """Invariant EKF whose state has the slow errors of each landmark's ranges and bearings, as Gauss-Markov processes.

    The gate is the EKF's: a sighting that fails the test replaces a landmark with which fewer than `gate_after` others
    have agreed.
    """

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._share, self._keep = np.array([options.range_share, options.bearing_share]), np.ones(2)
        self._times = options.range_time, options.bearing_time
        self._gate = -2 * log(1 - options.gate) if options.gate > 0 else 0.0  # the quantile, at two degrees of freedom
        self._confirm = options.gate_after
        self._origin = np.array([*prior.pose[:2], 0.0])  # of the group; it affects rounding only
        self._slot: dict[int, int] = {}
        self._mean, self._cov, self._agreed = np.zeros(3), np.zeros((3, 3)), np.zeros(0, np.int64)
        self._mean[2], self._cov[:] = prior.pose[2], prior.cov
        self._held = 0  # landmarks of a given map without covariance, which come first
        self._t: float | None = None
        self._motion = np.zeros((4, 3))
        self._nis, self._nis_dof, self._refused = 0.0, 0, 0
        self._arrays = self._reserve(SPACE)
        if prior.map is not None:
            self._adopt(prior.map)

    def step(self, step: Step) -> Pose:
        """Predicts with the odometry and the time, corrects by sightings one by one, and adds new landmarks."""
        passed = 0.0 if self._t is None else step.t - self._t
        self._t = step.t
        slot = self._slot
        n = 3 + EACH * len(slot)
        ids, z, R = step.sightings
        slots = np.array([slot.setdefault(landmark, len(slot)) for landmark in ids.tolist()], np.int64)
        self._arrays = self._reserve(len(slot))
        if step.odometry is not None:
            self._motion[0], self._motion[1:] = step.odometry
        self._keep[:] = [exp(-passed / time) for time in self._times]
        failed, why, self._nis, self._nis_dof, self._refused = frame(
            self._arrays.address, n, self._held, step.odometry is not None, slots, np.array(z), np.array(R, order="C"),
            self._gate, self._confirm,
        )  # fmt: skip
        if why == AT_ROBOT:
            raise Diverged(
                f"the estimate of landmark {ids[failed]} lies at the robot's own position: it has no bearing"
            )
        if why:
            raise Diverged(f"the innovation covariance of landmark {ids[failed]} is not positive definite")
        return self._mean[:3] + self._origin

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the sightings of known landmarks that were used."""
        nis = self._nis if self._nis_dof else None
        return Belief(
            self._mean[:3] + self._origin, self._cov[:3, :3].copy(), nis, self._nis_dof, refused=self._refused
        )

    def map(self) -> Map:
        """All landmarks in order of first sighting, with their joint covariance, slow errors aside."""
        entries = _places(len(self._slot))
        xy = self._mean[entries].reshape(-1, 2) + self._origin[:2]
        return Map(np.fromiter(self._slot, np.int64, len(self._slot)), xy, self._cov[np.ix_(entries, entries)])

    def finish(self) -> Solution | None:
        """None: a filter that keeps no path."""
        return None

    def _adopt(self, given: Map) -> None:
        """Starts from a given map; one without covariance is held fixed."""
        n = len(given.ids)
        self._slot = {landmark: k for k, landmark in enumerate(given.ids.tolist())}
        self._arrays = self._reserve(n)
        self._agreed[:n] = self._confirm
        entries = _places(n)
        self._mean[entries] = (given.xy - self._origin[:2]).ravel()
        slow = np.arange(3, 3 + EACH * n).reshape(-1, EACH)[:, 2:].ravel()
        self._cov[slow, slow] = 1.0
        if given.cov is None:
            self._held = n
        else:
            self._cov[np.ix_(entries, entries)] = given.cov

    def _reserve(self, landmarks: int) -> BiasedArrays:
        """The arrays, with space for that many landmarks."""
        space = len(self._agreed)
        if landmarks <= space:
            return self._arrays
        more = max(2 * space, landmarks) - space
        self._agreed = np.pad(self._agreed, (0, more))
        self._mean = np.pad(self._mean, (0, EACH * more))
        self._cov = np.pad(self._cov, ((0, EACH * more), (0, EACH * more)))
        return BiasedArrays(
            mean=self._mean, cov=self._cov, agreed=self._agreed, share=self._share, keep=self._keep, motion=self._motion
        )


def _places(landmarks: int) -> Ints:
    """Entries (2 n,) of the landmarks' places in the state."""
    return np.arange(3, 3 + EACH * landmarks).reshape(-1, EACH)[:, :2].ravel()


build = Builder(BiasEkf, options=Options, implementation=COMPILED_HERE)
