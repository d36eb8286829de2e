"""The Victoria Park log, from the copy in the gtsam wheel: a car with a laser scanner among the trees of a Sydney park.

J. E. Guivant and E. M. Nebot, "Optimization of the simultaneous localization and map-building algorithm for real-time
implementation", IEEE Trans. Robotics and Automation 17(3), 2001; prepared as relative motions and tree sightings with
known ids for iSAM (M. Kaess et al., 2008). Pose and tree ids share one name space there, so pose ids skip.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...core.factors import Dataset
from ...core.options import option
from ..formats import gtsam_text
from ..hidden_ids import HiddenIds
from ..registry import Source

_NOTES = {
    "source": "victoria_park.txt as shipped with GTSAM; Guivant and Nebot, University of Sydney, 2001",
    "licence": "none stated for the recording; GTSAM's copy is distributed under GTSAM's BSD licence",
    "sightings": "x, y with their covariance in the file; range and bearing by first-order propagation",
}


@dataclass(frozen=True)
class Options(HiddenIds):
    """Factors on the file's noise, and the ids."""

    odometry_sd: float = option(
        1.0, "standard deviation of odometry, times what the file states: it is off by more than that", minimum=1e-3
    )


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - a recorded log is not random
    """Victoria Park: a real car among trees, 6,969 steps, 3,640 sightings of 151 known trees, no ground truth."""
    log, truth = gtsam_text.read(gtsam_text.shipped("victoria_park.txt"), "cov", "victoria-park", _NOTES)
    if options.odometry_sd == 1:
        return Dataset(log, truth)
    cov = options.odometry_sd**2 * log.delta_cov
    cov.flags.writeable = False
    return Dataset(replace(log, delta_cov=cov), truth)


source = Source(make, Options)
