"""Minimises J on the incremental smoother's tree, ordered once: see `batch`."""

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...core.factors import Log, Prior, Step
from ..api import Diverged, Solution
from ..common_options import LOSSES
from ..smoothing.smoother import Options as SmootherOptions
from ..smoothing.smoother import Smoother
from ..smoothing.valleys import freed, here, near
from .batch import Batch
from .gauss_newton import eliminate
from .graduated import leave_out
from .graph_options import Options

FREED = 100  # most iterations of each further fit where landmarks are passed over


def optimum(prior: Prior, options: Options, steps: Sequence[Step]) -> Solution:
    """Path, map and, where J is curved in every direction, the covariances of both; Diverged without an optimum."""
    log = Log.from_steps("batch", prior, steps)
    if options.start == "odometry":
        batch = _empty(log, options)
        batch.start_by_odometry()
    elif options.gnc or options.loss != "none":
        batch = _started_online(log, options, steps)
    else:
        batch = _empty(log, options)
        batch.start_by_chunks()
    if options.gnc:
        leave_out(batch, options.iterations)
    converged = _fit(batch, options)
    if near(batch.forest.g) and not options.gnc:
        batch = _freed(batch, options, steps)
    return batch.solution(options.joint_up_to, options.iterations, converged)


def _empty(log: Log, options: Options) -> Batch:
    loss = "none" if options.gnc else options.loss
    return Batch(log, list(LOSSES).index(loss), options.loss_scale or LOSSES[loss])


def _fit(batch: Batch, options: Options) -> bool:
    return batch.fit(options.relative_tolerance, options.iterations).converged


def _freed(batch: Batch, options: Options, steps: Sequence[Step]) -> Batch:
    """The lowest fit of a log with landmarks that are passed over: also from softened bearings, and another start."""
    options, batches = replace(options, iterations=min(options.iterations, FREED)), [batch]
    with contextlib.suppress(Diverged):
        other = _started_online(batch.log, options, steps)
        _fit(other, options)
        batches.append(other)
    for one in batches:
        if eliminate(one.forest):
            freed(one.forest, partial(_fit, one, options))
    return min(batches, key=lambda one: here(one.forest))


def _started_online(log: Log, options: Options, steps: Sequence[Step]) -> Batch:
    """Starts from the final estimate of an incremental smoother, with a robust loss where outliers are to be expected.

    A landmark without two agreeing sightings starts at its last one.
    """
    loss = "cauchy" if options.gnc else options.loss
    wanted = SmootherOptions(loss=loss, loss_scale=options.loss_scale, joint_up_to=0)
    online = Smoother(log.prior, wanted, np.random.default_rng(0))
    for step in steps:
        online.step(step)
    path, landmarks, *_ = online.finish()
    batch = _empty(log, options)
    batch.start_at(path, landmarks)
    return batch
