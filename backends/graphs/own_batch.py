"""Minimises J on the incremental smoother's tree, ordered once: see `batch`."""

from collections.abc import Sequence

import numpy as np

from ...core.factors import Log, Prior, Step
from ..api import Solution
from ..common_options import LOSSES
from ..smoothing.smoother import Options as SmootherOptions
from ..smoothing.smoother import Smoother
from .batch import Batch
from .graduated import leave_out
from .graph_options import Options


def optimum(prior: Prior, options: Options, steps: Sequence[Step]) -> Solution:
    """Path, map and, where J is curved in every direction, the covariances of both; Diverged without an optimum."""
    log = Log.from_steps("batch", prior, steps)
    loss = "none" if options.gnc else options.loss
    batch = Batch(log, list(LOSSES).index(loss), options.loss_scale or LOSSES[loss])
    if options.start == "odometry":
        batch.start_by_odometry()
    elif options.gnc or options.loss != "none":
        _start_robustly(batch, prior, options, steps)
    else:
        batch.start_by_chunks()
    if options.gnc:
        leave_out(batch, options.iterations)
    fit = batch.fit(options.relative_tolerance, options.iterations)
    return batch.solution(options.joint_up_to, fit.converged)


def _start_robustly(batch: Batch, prior: Prior, options: Options, steps: Sequence[Step]) -> None:
    """Starts from the final estimate of an incremental smoother with a robust loss.

    A landmark without two agreeing sightings starts at its last one.
    """
    loss = "cauchy" if options.loss == "none" else options.loss
    wanted = SmootherOptions(loss=loss, loss_scale=options.loss_scale, joint_up_to=0)
    online = Smoother(prior, wanted, np.random.default_rng(0))
    for step in steps:
        online.step(step)
    path, landmarks, *_ = online.finish()
    batch.start_at(path, landmarks)
