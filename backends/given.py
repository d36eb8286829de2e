"""The part of a log that a backend is given."""

from dataclasses import replace
from typing import NamedTuple

from ..core.factors import UNKNOWN, Log
from .api import Builder


class Given(NamedTuple):
    """A log without the factors that a backend runs without, and how many of each kind these are."""

    log: Log
    loops: int = 0
    partial: int = 0
    fixes: int = 0
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


def given(builder: Builder, log: Log) -> Given:
    """The log as the backend gets it, of one that is not refused; partial sightings need an id."""
    loops = 0 if builder.loops else len(log.loop_to)
    known = 0 if log.partial is None or not builder.partial else int((log.partial.ids != UNKNOWN).sum())
    partial = 0 if log.partial is None else len(log.partial) - known
    fixes = 0 if builder.fixes or log.fixes is None else len(log.fixes)
    log = log.without_loops() if loops else log
    if log.partial is not None and partial:
        log = replace(log, partial=log.partial.rows(log.partial.ids != UNKNOWN) if builder.partial else None)
    wheels = log.prior.systematic.wheel_scale > 0 and not builder.wheel_scale
    return Given(log.without_fixes() if fixes else log, loops, partial, fixes, wheels)
