"""Two dives of GOATS 2002 from the gtsam wheel: an underwater vehicle with acoustic ranges to beacons, as PyFG files.

The vehicle is MIT's; the files are of py-factor-graph (MarineRoboticsGroup/PyFactorGraph). Their poses are dead
reckoning, not the truth, and their beacons are where these were moored, in another frame and to some ten metres: both
are left aside. The odometry and the ranges are as in the files, which have no times: t is the number of the step. The
noise that they state of a range, 0.75 m, is too small: at the optimum of the first dive 90 % are within 5 m, and one is
120 m off, at a motion of 90 m aside at step 198, which no vehicle does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...core.factors import Dataset
from ...core.options import option
from ..formats import gtsam_text
from ..graphs import pyfg
from ..registry import Source


@dataclass(frozen=True)
class Options:
    """Which dive, and its noise."""

    log: int = option(15, "the dive: 15 with three beacons, 16 with four", minimum=15, maximum=16)
    range_sd: float | None = option(
        None, "standard deviation of a range, m; not given: as in the file, 0.75", minimum=1e-3, maximum=1e3
    )


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """GOATS 15 and 16: an underwater vehicle, 786 or 572 ranges alone to three or four beacons, no ground truth."""
    (path,) = _files(options)
    log = pyfg.read(path).log
    notes = {
        **log.notes,
        "source": f"{path.name} as shipped with GTSAM; GOATS 2002, MIT",
        "licence": "none stated for the recording; GTSAM's copy is distributed under GTSAM's BSD licence",
        "truth": "none: the file's poses are dead reckoning, its beacons are in another frame",
    }
    if options.range_sd is not None and log.partial is not None:
        var = np.full(len(log.partial), options.range_sd**2)
        var.flags.writeable = False
        log = replace(log, partial=replace(log.partial, var=var))
    return Dataset(replace(log, name=f"goats{options.log}", notes=notes), None)


def _files(options: Options) -> Sequence[Path]:
    return [gtsam_text.shipped(f"goats_{options.log}.pyfg")]


source = Source(make, Options, files=_files)
