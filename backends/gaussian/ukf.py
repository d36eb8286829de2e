"""UKF-SLAM in square-root form, with sigma points only where a model touches the state.

The unscented transform (Julier and Uhlmann, A New Extension of the Kalman Filter to Nonlinear Systems, 1997; scaled as
by Wan and van der Merwe, 2000) replaces the EKF's Jacobians by a regression over a few points as far apart as the
belief is wide. The whole state need not be sampled: a motion depends on the pose and its own noise alone, a sighting on
the pose and one landmark, so 13 or 11 points do whatever the size of the map (Huang, Mourikis and Roumeliotis, On the
Complexity and Consistency of UKF-based SLAM, ICRA 2009). The covariance is kept as its triangular root (van der Merwe
and Wan, The Square-Root Unscented Kalman Filter, ICASSP 2001; for SLAM Holmes, Klein and Murray, ICRA 2008) and
corrected as Carlson (1973) does it, which needs no downdate and cannot lose positive definiteness. Angles are averaged
as differences from the one in the middle, wrapped.

The models are those of ArUco EKF SLAM: eq. (2) for a motion, (12) for a sighting, (17) for a new landmark.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...frontend.factors import Map, Odometry, Prior, RangeBearing, Step
from ...frontend.options import option
from ...frontend.se2 import Array
from ..api import COMPILED_HERE, Belief, Builder, Diverged, Pose
from . import _ukf
from ._root import LANES, OWED, first

SPACE = 64
"""State entries reserved at first."""


@dataclass(frozen=True)
class Options:
    """How the sigma points are spread and weighted; with any of these the covariance stays one."""

    alpha: float = option(1.0, "how far out sigma points lie; 1 is sqrt(dimensions + kappa)", minimum=1e-3, maximum=2)
    beta: float = option(2.0, "more weight for the point in the middle; 2 suits a Gaussian", minimum=0, maximum=10)
    kappa: float = option(0.0, "added to the number of dimensions in the points' spread", minimum=0, maximum=10)


class Ukf:
    """Unscented Kalman filter, square-root form: sigma points in the place of Jacobians, where a model touches."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._scaling = np.array([options.alpha**2, options.kappa, options.beta - options.alpha**2])
        self._slot: dict[int, int] = {}  # landmark id -> its number, or -2 less its number among those held fixed
        self._known = np.zeros((0, 2))  # landmarks held fixed, m
        self._n = 0  # entries of the landmarks' mean
        self._pose = np.array(prior.pose)
        self._mean = np.zeros(0)
        self._packed = np.zeros(0)  # the landmarks' rows of the root
        self._rows = np.zeros((3, 0))  # the pose's
        self._reserve(SPACE)
        self._rows[:, :3] = np.linalg.cholesky(prior.cov)
        self._nis = np.zeros(0)  # of each sighting of the last step, -1 for none
        if prior.map is not None:
            self._adopt(prior.map)

    def step(self, step: Step) -> Pose:
        """Predict with the odometry, then take one sighting after another: correct, or add a landmark not yet known."""
        if step.odometry is not None:
            self._predict(step.odometry)
        self._nis = np.empty(len(step.sightings.ids))
        if len(self._nis):
            self._take(step.sightings)
        return self._pose.copy()

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the step's sightings of landmarks already known."""
        rows = self._rows[:, : self._n + 3]
        nis = self._nis[self._nis >= 0]
        return Belief(self._pose.copy(), rows @ rows.T, float(nis.sum()) if len(nis) else None, 2 * len(nis))

    def map(self) -> Map:
        """All landmarks with their joint covariance, those held fixed first, then as they were first seen."""
        root, fixed = self._root(), self._known.size
        cov = np.zeros((fixed + self._n, fixed + self._n))
        cov[fixed:, fixed:] = root @ root.T
        xy = np.concatenate((self._known, self._mean[: self._n].reshape(-1, 2)))
        return Map(np.fromiter(self._slot, np.int64, len(self._slot)), xy, cov)

    def finish(self) -> None:
        """None: a filter does not look back."""

    def _predict(self, odometry: Odometry) -> None:
        delta, cov = np.array(odometry.delta), np.array(odometry.cov)
        if not _ukf.move(self._pose, self._rows, self._n, delta, cov, self._scaling, self._work):
            raise Diverged("the predicted pose's covariance is not positive definite")

    def _take(self, seen: RangeBearing) -> None:
        """Correct by the sightings of landmarks that are known, and add the others, all in their order."""
        slot, count = self._slot, self._n // 2
        slots = [slot.get(landmark, -1) for landmark in seen.ids.tolist()]
        if -1 in slots:
            fresh = [landmark for landmark in seen.ids.tolist() if landmark not in slot]
            slot.update(zip(fresh, range(count, count + len(fresh)), strict=True))
            self._reserve(2 * len(slot))
        self._n, wrong = _ukf.take(
            self._pose,
            self._rows,
            self._packed,
            self._mean,
            self._n,
            self._known,
            np.array(slots),
            np.array(seen.z),
            np.array(seen.cov, order="C"),
            self._scaling,
            self._work,
            self._scans,
            self._gains,
            self._nis,
        )
        if wrong:
            raise Diverged(f"the covariance of {_ukf.WRONG[wrong]} is not positive definite")

    def _adopt(self, given: Map) -> None:
        """Start from a given map; landmarks without covariance are held fixed, outside of the state."""
        m = len(given.ids)
        if given.cov is None:
            self._known = np.array(given.xy)
            self._slot = {landmark: -2 - k for k, landmark in enumerate(given.ids.tolist())}
            return
        self._reserve(2 * m)
        self._slot = {landmark: k for k, landmark in enumerate(given.ids.tolist())}
        self._n, self._mean[: 2 * m] = 2 * m, given.xy.ravel()
        self._rows[:, 2 * m : 2 * m + 3] = self._rows[:, :3].copy()
        self._rows[:, : 2 * m] = 0.0
        try:
            root = np.linalg.cholesky(given.cov)
        except np.linalg.LinAlgError:
            raise Diverged("the covariance of the given map is not positive definite") from None
        for rows, columns in self._blocks():
            columns.T[: rows.stop - rows.start] = root[rows, : len(columns)]

    def _root(self) -> Array:
        """(n, n) the landmarks' rows of the root, lower triangular."""
        root = np.zeros((self._n, self._n))
        for rows, columns in self._blocks():
            root[rows, : len(columns)] = columns.T[: rows.stop - rows.start]
        return root

    def _blocks(self) -> Iterator[tuple[slice, Array]]:
        """The packed rows, block by block: which they are, and a view of their columns (width, LANES)."""
        for start in range(0, self._n, LANES):
            at, stop = first(start // LANES), min(start + LANES, self._n)
            yield slice(start, stop), self._packed[at : at + LANES * stop].reshape(stop, LANES)

    def _reserve(self, entries: int) -> None:
        """Make room for that many entries of the landmarks' mean, and for half as many again where there is none."""
        if entries <= len(self._mean):
            return
        space = max(SPACE, entries + entries // 2)
        self._mean.resize(space, refcheck=False)
        self._packed.resize(first(-(-space // LANES)), refcheck=False)  # in place where the system can, zeros behind
        self._rows = np.hstack((self._rows, np.zeros((3, space + 3 - self._rows.shape[1]))))
        self._work = np.empty((7, space + 3))
        self._scans, self._gains = np.empty((space + 3, OWED, 3)), np.empty(OWED)


build = Builder(Ukf, options=Options, implementation=COMPILED_HERE)
