"""Batch GraphSLAM: the minimum of the survey's J_GraphSLAM over the whole path and map.

J is the sum of the prior's, every odometry factor's and every sighting's squared Mahalanobis distance
(`bench/measure/misfit.py`). The optimum is the reference for logs without ground truth. There are two solvers: our own
and, as an independent check, GTSAM's, with its native factors. GTSAM's residual of a motion is the full logarithm of
SE(2), ours the plain difference of poses: another J, where motions fit badly. At their minima the two differ by a share
of 1e-7 on Victoria Park, 7e-6 on Huang's circle and 7e-4 on MRCLAM 6, robot 1; the paths by up to 0.3, 2.9 and 1.5 mm.

Two options limit the effect of outliers among sightings and loop closures. A robust loss makes J grow slower with
distance. Graduated non-convexity (H. Yang, P. Antonante, V. Tzoumas and L. Carlone, "Graduated non-convexity for robust
spatial perception", IEEE RA-L 5(2), 2020) rejects them, starting from a convex J. Odometry is never weighted.
"""

import numpy as np

from ...core.factors import Map, Prior, Step
from ..api import COMPILED_HERE, GTSAM_WHEEL, Builder, Solution
from .graph_options import Options
from .own_batch import optimum


class Graph:
    """Batch GraphSLAM: the optimum over the whole log, by our own solver or by GTSAM."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._prior, self._options = prior, options
        self._steps: list[Step] = []

    def step(self, step: Step) -> None:
        """Stores the step; None: a batch has no online estimate."""
        self._steps.append(step)

    def belief(self) -> None:
        """None: a batch has no online belief."""

    def map(self) -> Map:
        """The given map, or an empty one; the batch's own is in `finish`."""
        return self._prior.map or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> Solution:
        """The optimum: path, map and, where J is curved in every direction, the covariances of both."""
        if self._options.solver == "gtsam":
            from .gtsam_batch import GtsamBatch  # a large library

            return GtsamBatch(self._prior, self._options, self._steps).optimum()
        return optimum(self._prior, self._options, self._steps)


def implementation(options: Options) -> str:
    """The solver's implementation."""
    return COMPILED_HERE if options.solver == "own" else GTSAM_WHEEL


def minimises(options: Options) -> bool:
    """True without a robust loss or rejection."""
    return options.loss == "none" and not options.gnc


build = Builder(
    Graph,
    options=Options,
    online=False,
    loops=True,
    partial=True,
    fixes=True,
    gyro=True,
    minimises=minimises,
    implementation=implementation,
)
