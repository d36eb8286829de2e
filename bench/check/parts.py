"""Checks a backend that takes sightings of a range or a bearing alone, or fixes of the pose in the world."""

from dataclasses import replace

import numpy as np

from ...backends.api import Calibrates, Pose
from ...core.factors import Log, Systematic
from ...core.fixes import FixTable
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import wrap
from ..measure.answers import checked_calibration, checked_solution
from .candidate import ROUNDING, Candidate, Failed, NotApplicable, same
from .estimates import BIAS
from .small_logs import SmallLog, around, dead_reckoned, drive

SECOND = 10  # steps
FIX_SD = 0.1  # m
SCALE, PRIOR_SD = 0.05, 0.1  # of ranges
MOST_SDS = 6.0


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


def constants_are_near_the_truth(candidate: Candidate) -> str:
    """A scale of ranges that it estimates is right within what it states, and asking for it changes nothing."""
    if not candidate.builder.partial:
        raise NotApplicable("a log with sightings of a range or a bearing alone is skipped for it")
    log = longer(halves(drive(np.random.default_rng(30), around(170)).log), SCALE)
    backend, path = candidate.fresh(log.prior), list[Pose | None]()
    for step in log:
        path.append(backend.step(step))
        if isinstance(backend, Calibrates):
            checked_calibration(backend)
    solution = checked_solution(backend.finish(), len(log))
    constant = checked_calibration(backend).constant if solution is None or solution.constant is None else None
    constant = solution.constant if solution is not None and constant is None else constant
    if constant is None:
        raise NotApplicable("it estimates no constant errors, or does not say so")
    asked = {} if path[0] is None else {"online": np.array(path)}
    alone = candidate.run(log).paths
    same(
        asked, {name: poses for name, poses in alone.items() if name in asked}, "a run asked for constants, and one not"
    )
    off = abs(float(constant.range_scale[0]) - SCALE)
    if constant.sd is None:
        if not off <= SCALE / 2:
            raise Failed(f"the scale of ranges is {off:.3g} off, expected at most {SCALE / 2:g}")
        return f"the scale of ranges is {off:.2g} off, without a standard deviation"
    sd = float(constant.sd.range_scale[0])
    if not 0 < sd < PRIOR_SD:
        raise Failed(f"the scale's standard deviation is {sd:.3g}, expected above 0 and below the prior's {PRIOR_SD:g}")
    least = SCALE / 2 if candidate.builder.random else 0.0  # a few particles state too little
    if not off <= max(MOST_SDS * sd, least):
        raise Failed(f"the scale of ranges is {off / sd:.1f} standard deviations off, expected at most {MOST_SDS:g}")
    return f"the scale of ranges is {off / sd:.1f} of its standard deviations off"


def longer(log: Log, scale: float) -> Log:
    """The log with ranges alone too long by this share, which its prior does not know but to PRIOR_SD."""
    assert log.partial is not None
    z = np.where(log.partial.kind == RANGE, (1 + scale) * log.partial.z, log.partial.z)
    prior = log.prior._replace(systematic=Systematic(range_scale=PRIOR_SD))
    table = log.partial
    partial = PartialTable.from_arrays(len(log), table.step, table.ids, table.kind, z, table.var)
    return replace(log, prior=prior, partial=partial)


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


CHECKS = (halves_of_sightings_count_as_whole_ones, a_position_each_second_is_used, constants_are_near_the_truth)
