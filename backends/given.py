"""The part of a log that a backend is given."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..core.arrays import frozen
from ..core.factors import UNKNOWN, Log
from ..core.gyro import Bias, fused
from .api import Builder
from .common_options import FRONT, IGNORED, STATE


class Given(NamedTuple):
    """A log without the factors that a backend runs without, and how many of each kind these are."""

    log: Log
    loops: int = 0
    partial: int = 0
    fixes: int = 0
    turns: int = 0  # of a gyro, which are not left out, but in the odometry
    bias: str = ""  # how the gyro's bias was treated for this
    wheel_scale: bool = False  # true: that of the prior, which it takes as none


def refused(builder: Builder, log: Log) -> str:
    """Names the factors of a log for which the backend cannot run on it; "" if there are none."""
    if log.prior.loops and not builder.loops and not builder.leaves_out_loops:
        return "the log has loop closures (RelativePoses), which this backend does not take"
    if log.prior.partial and not builder.partial and not builder.without("partial"):
        return "the log has sightings of a range or a bearing alone (Partial), which this backend does not take"
    if log.prior.fixes and not builder.fixes and not builder.without("fixes"):
        return "the log has positions or headings in the world (Fixes), which this backend does not take"
    return ""


def given(builder: Builder, log: Log, options: Any = None) -> Given:
    """The log as the backend gets it with its options, of one that is not refused.

    Partial sightings need an id, unless it associates them.
    """
    loops = 0 if builder.loops else len(log.loop_to)
    partial = 0
    if log.partial is not None and not builder.partial:
        partial = len(log.partial)
    elif log.partial is not None and not (builder.associates_partial and builder.associates_partial(options)):
        partial = int((log.partial.ids == UNKNOWN).sum())
    fixes = 0 if builder.fixes or log.fixes is None else len(log.fixes)
    log = log.without_loops() if loops else log
    if log.partial is not None and partial:
        log = replace(log, partial=log.partial.rows(log.partial.ids != UNKNOWN) if builder.partial else None)
    log, turns, bias = _turned(builder, log, options)
    wheels = log.prior.systematic.wheel_scale > 0 and not builder.wheel_scale
    return Given(log.without_fixes() if fixes else log, loops, partial, fixes, turns, bias, wheels)


def _turned(builder: Builder, log: Log, options: Any) -> tuple[Log, int, str]:
    """The log with its gyro's turns in the odometry, unless the bias is to be a state; their number, and the way."""
    gyro, way = log.gyro, getattr(options, "gyro", STATE) if builder.gyro else FRONT
    if gyro is None or way == STATE:
        return log, 0, ""
    if way == IGNORED:
        gyro = replace(gyro, bias=frozen(np.array(Bias())), walk=frozen(np.zeros(len(gyro))))
    delta, cov = fused(gyro, log.delta, log.delta_cov)
    log = replace(log, delta=frozen(delta), delta_cov=frozen(cov), gyro=None)
    return log, len(gyro), "ignored" if way == IGNORED else "estimated in front"
