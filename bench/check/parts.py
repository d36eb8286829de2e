"""Checks a backend that takes sightings of a range or a bearing alone, or fixes of the pose in the world."""

from dataclasses import replace

import numpy as np

from ...core.factors import Log
from ...core.fixes import FixTable
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import wrap
from .candidate import ROUNDING, Candidate, Failed, NotApplicable
from .estimates import BIAS
from .small_logs import SmallLog, around, dead_reckoned, drive

SECOND = 10  # steps
FIX_SD = 0.1  # m


def halves_of_sightings_count_as_whole_ones(candidate: Candidate) -> str:
    """A range and a bearing of a landmark, each by itself, tell what both together do; a minimum of J is the same."""
    if not candidate.builder.partial:
        raise NotApplicable("a log with sightings of a range or a bearing alone is skipped for it")
    biased = drive(np.random.default_rng(26), around(85), errors=0.0, bias=BIAS)
    found = _hold(candidate, biased._replace(log=halves(biased.log)))
    if not candidate.builder.minimising(candidate.options):
        return found
    log = _uncorrelated(drive(np.random.default_rng(27), around(90), scale=0.1).log)
    whole, parts = (candidate.run(one).paths["final"] for one in (log, halves(log)))
    between = whole - parts
    between[:, 2] = wrap(between[:, 2])
    furthest = float(np.abs(between).max())
    if not furthest <= ROUNDING:
        raise Failed(f"by halves the final path is {furthest:.2g} m off that by whole sightings, expected the same")
    return f"{found}; by halves the final path is the same to {furthest:.1g} m"


def a_position_each_second_is_used(candidate: Candidate) -> str:
    """Positions in the world, one a second, hold a path that biased odometry alone would leave."""
    if not candidate.builder.fixes:
        raise NotApplicable("a log with positions or headings in the world is skipped for it")
    drifting = drive(np.random.default_rng(28), around(85), bias=BIAS, reach=0.0)
    return _hold(candidate, with_positions(drifting, np.random.default_rng(29)))


def _hold(candidate: Candidate, made: SmallLog) -> str:
    """Tells that a backend's paths end near the truth though odometry's does not."""
    drift = float(np.hypot(*(dead_reckoned(made.log)[0] - made.path)[-1, :2]))
    for which, path in candidate.run(made.log).paths.items():
        off = float(np.hypot(*(path - made.path)[-1, :2]))
        if not off <= drift / 2:
            raise Failed(f"the {which} path ends {off:.3g} m off, expected less than half of odometry's {drift:.3g} m")
    return f"dead reckoning ends {drift:.2g} m off, the paths less than half of that"


def halves(log: Log) -> Log:
    """The log with each sighting as a range and a bearing, each by itself."""
    n, s = len(log), len(log.ids)
    var = np.diagonal(log.z_cov, axis1=1, axis2=2)
    kind = np.tile((RANGE, BEARING), s)
    step, ids = np.repeat(log.sighting_step, 2), np.repeat(log.ids, 2)
    partial = PartialTable.from_arrays(n, step, ids, kind, log.z.ravel(), var.ravel())
    none = np.zeros_like(log.sighting_first)
    return replace(log, sighting_first=none, ids=log.ids[:0], z=log.z[:0], z_cov=log.z_cov[:0], partial=partial)


def with_positions(made: SmallLog, rng: np.random.Generator) -> SmallLog:
    """Adds a position each second, off by FIX_SD."""
    step = np.arange(SECOND, len(made.log), SECOND)
    z, cov = np.full((len(step), 3), np.nan), np.full((len(step), 3, 3), np.nan)
    z[:, :2] = made.path[step, :2] + FIX_SD * rng.standard_normal((len(step), 2))
    cov[:, :2, :2] = FIX_SD**2 * np.eye(2)
    return made._replace(log=replace(made.log, fixes=FixTable.from_arrays(len(made.log), step, z, cov)))


def _uncorrelated(log: Log) -> Log:
    return replace(log, z_cov=log.z_cov * np.eye(2))


CHECKS = (halves_of_sightings_count_as_whole_ones, a_position_each_second_is_used)
