"""Fixed-lag smoothing over poses and landmarks of the last seconds, by our solver or GTSAM's."""

from dataclasses import dataclass

import numpy as np

from ...core.factors import Prior
from ...core.options import option
from ..api import COMPILED_HERE, GTSAM_WHEEL, Backend, Builder
from ..window import fixed_lag


@dataclass(frozen=True)
class Options(fixed_lag.Options):
    """Length of the window, relinearisation, and the solver."""

    solver: str = option("own", "this package's solver, or GTSAM's", choices=("own", "gtsam"))


def make(prior: Prior, options: Options, rng: np.random.Generator) -> Backend:
    """Fixed-lag smoothing: poses and landmarks of the last seconds, with a Gaussian prior for older ones."""
    if options.solver == "own":
        return fixed_lag.FixedLag(prior, options, rng)
    from .gtsam_fixed_lag import GtsamFixedLag

    return GtsamFixedLag(prior, options, rng)


def implementation(options: Options) -> str:
    """The solver's implementation."""
    return COMPILED_HERE if options.solver == "own" else GTSAM_WHEEL


build = Builder(
    make,
    options=Options,
    forgets=True,
    partial=True,
    fixes=True,
    gyro=True,
    expects=True,
    implementation=implementation,
)
