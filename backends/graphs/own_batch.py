"""Minimises J on the incremental smoother's tree, ordered once: see `batch`.

A start that is good enough costs an iteration, one that is certain many: smoothed chunk by chunk. So a cheap start is
tried first, and its fit is trusted, or not, by what does not depend on how well noise is stated.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...core.factors import Log, Prior, Step
from ...core.se2 import Array
from ..api import Diverged, Solution
from ..common_options import LOSSES
from ..incremental.smoother import Options as SmootherOptions
from ..incremental.smoother import Smoother
from ..smoothing.valleys import freed, here, near
from .batch import Batch
from .distances import unevenness
from .elsewhere import lowest
from .gauss_newton import eliminate
from .graduated import leave_out
from .graph_options import Options

FREED = 100  # most iterations of each further fit where landmarks are passed over

AT_ONCE = 10
"""Most iterations of a fit that may be trusted.

From dead reckoning that is too far off, J falls slowly, or ends in another minimum after many more. How many it takes
does not depend on the scale of the noise that is stated.
"""

SAME = 1e-6  # relative difference of J up to which two fits end at one minimum


def optimum(prior: Prior, options: Options, steps: Sequence[Step], along: Array | None = None) -> Solution:
    """Path, map and, where J is curved in every direction, the covariances of both; Diverged without an optimum.

    `along` (n, 3) is a path to start with in place of dead reckoning.
    """
    log = Log.from_steps("batch", prior, steps)
    trusted = False
    if options.start == "auto" and not options.gnc and options.loss == "none":
        batch, converged, trusted = _chosen(log, options, along)
    else:
        batch = _started(log, options, steps, along)
        if options.gnc:
            leave_out(batch, options.iterations)
        converged = _fit(batch, options)
    if not options.gnc and log.partial is not None:
        start = log.dead_reckoned() if along is None else along
        lower = lowest(batch, start, partial(_empty, log, options))
        if lower is not batch:
            lower.refit()
            batch, converged = lower, _fit(lower, options)
    if near(batch.forest.g) and not options.gnc:
        batch = _freed(batch, options, () if trusted or _has_parts(log) else steps)
    return batch.solution(options.joint_up_to, options.iterations, converged)


def _chosen(log: Log, options: Options, along: Array | None) -> tuple[Batch, bool, bool]:
    """A fit, whether it converged and is trusted: one from a cheap start if so, else the lowest of all starts."""
    tried = list[Batch]()
    with contextlib.suppress(Diverged):
        if _is_trusted(log, options, along, tried):
            return tried[0], True, True
    batch = _empty(log, options)
    batch.start_by_chunks()
    converged = _fit(batch, options)
    lower = min(tried, key=lambda one: here(one.forest), default=batch)
    if here(lower.forest) < here(batch.forest) * (1 - SAME):
        with contextlib.suppress(Diverged):
            lower.refit()
            return lower, _fit(lower, options), False
    return batch, converged, False


def _is_trusted(log: Log, options: Options, along: Array | None, tried: list[Batch]) -> bool:
    """Tells if the fit from a cheap start is to be trusted; its batches are added to `tried`, that one first.

    It takes few iterations, and its distances are even or the other start takes few, too, to the same J.
    """
    for start in ("headings", "odometry") if len(log.loop_to) else ("odometry",):
        batch = _empty(log, options)
        _start(batch, start, along)
        tried.append(batch)
        if not batch.fit(options.relative_tolerance, min(AT_ONCE, options.iterations)).converged:
            return False
        if len(tried) == 1:
            uneven = unevenness(log, *batch.place())
            if uneven <= 1 or uneven == np.inf:
                return uneven <= 1
    return len(tried) == 2 and _are_same(tried)


def _are_same(batches: Sequence[Batch]) -> bool:
    costs = [here(batch.forest) for batch in batches]
    return max(costs) - min(costs) <= SAME * min(costs)


def _started(log: Log, options: Options, steps: Sequence[Step], along: Array | None) -> Batch:
    """A batch as the options say, from a robust smoother where outliers are to be expected."""
    if options.start in ("auto", "incremental") and (options.gnc or options.loss != "none") and not _has_parts(log):
        return _started_online(log, options, steps)
    batch = _empty(log, options)
    _start(batch, options.start, along)
    return batch


def _has_parts(log: Log) -> bool:
    """True for a log with other factors than motions, whole sightings and loops: chunks give its start."""
    return log.partial is not None or log.fixes is not None or log.gyro is not None


def _start(batch: Batch, start: str, along: Array | None) -> None:
    if start == "headings":
        batch.start_by_headings()
    elif start == "odometry":
        batch.start_by_odometry(along)
    else:
        batch.start_by_chunks()


def _empty(log: Log, options: Options) -> Batch:
    loss = "none" if options.gnc else options.loss
    return Batch(log, list(LOSSES).index(loss), options.loss_scale or LOSSES[loss])


def _fit(batch: Batch, options: Options) -> bool:
    return batch.fit(options.relative_tolerance, options.iterations).converged


def _freed(batch: Batch, options: Options, steps: Sequence[Step]) -> Batch:
    """The lowest fit of a log with landmarks that are passed over: from softened bearings, and from `steps`, too."""
    options, batches = replace(options, iterations=min(options.iterations, FREED)), [batch]
    if steps:
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
