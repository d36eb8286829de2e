"""Fixed-lag smoothing, by this package's solver or by GTSAM's: poses and landmarks of the last seconds alone."""

from dataclasses import dataclass

import numpy as np

from ...frontend.factors import Prior
from ...frontend.options import option
from ..api import COMPILED_HERE, GTSAM_WHEEL, Backend, Builder
from ..window import fixed_lag


@dataclass(frozen=True)
class Options(fixed_lag.Options):
    """How long the window is, when its variables are relinearized, and who solves it."""

    solver: str = option("own", "this package's solver, or GTSAM's", choices=("own", "gtsam"))


def make(prior: Prior, options: Options, rng: np.random.Generator) -> Backend:
    """Fixed-lag smoothing: the last seconds' poses and landmarks, and a Gaussian prior of what is older."""
    if options.solver == "own":
        return fixed_lag.FixedLag(prior, options, rng)
    from .gtsam_fixed_lag import GtsamFixedLag

    return GtsamFixedLag(prior, options, rng)


def implementation(options: Options) -> str:
    """Whose program the solver is."""
    return COMPILED_HERE if options.solver == "own" else GTSAM_WHEEL


build = Builder(make, options=Options, forgets=True, implementation=implementation)
