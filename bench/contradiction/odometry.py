"""Odometry that a true path or a gyro contradicts, where sightings agree with these: of another drive, or of slip.

Sightings that contradict the odometry do not fit one another in a fit of both, and look like wrong ids or landmarks
that move. By the true path, or with ways that are free and the gyro's turns, they do fit.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...core.elementary import hypot
from ...core.factors import Dataset, Log, Truth
from ...core.se2 import wrap
from ...core.truth.errors import named, sighting_errors
from ..measure.landmark_places import comparable
from ..measure.stated_noise import squares_in, typical_scale
from ..systematic.motions_along import by_truth, far_out
from ..systematic.windows import windows
from ..words.numerals import number
from .fit import FAR, Fitted, fitted
from .outliers import MANY
from .stretch import stretches
from .truth import FROM_TRUTH, OTHER

FEWEST = 30
"""Sightings that tell that they fit."""

CAUSES = (
    "the odometry is of another drive or robot, its wheels slip, or its clock is wrong, and landmarks and ids are right"
)

FREE = 3.0
"""Times the usual motion of a step that a way is free by."""


def blamed(dataset: Dataset, fits: Sequence[tuple[Log, Fitted]]) -> str:
    """Says that the odometry is wrong, where sightings do not fit it but do fit the true path or the gyro; else ""."""
    log, truth = named(*dataset).identified(), dataset.truth
    said = _by_truth(log, truth) if truth is not None and truth.exact and len(truth.t) else ""
    return said or _by_gyro(log, fits)


def _by_truth(log: Log, truth: Truth) -> str:
    given = truth._replace(assigned=None, map=None)
    errors = sighting_errors(log, comparable(log, given))
    if len(errors.row) < FEWEST:
        return ""
    squares = squares_in(errors, log.z_cov)
    scale, far = typical_scale(squares, 2), float((squares > FAR).mean())
    share, count = far_out(log, *by_truth(log, truth), FAR)
    if scale > FROM_TRUTH or far > MANY or share < OTHER:
        return ""
    return (
        f"the odometry is not that of the true path: in {number(100 * share)} % of {count} stretches of time its "
        f"motions are far out from there, where sightings fit (typically {number(scale)} times what is stated): "
        f"{CAUSES}"
    )


def _by_gyro(log: Log, fits: Sequence[tuple[Log, Fitted]]) -> str:
    table = log.gyro
    if table is None or not fits:
        return ""
    first = windows(log.t, table.step)
    if not len(first):
        return ""
    bias = table.prior
    off = wrap(log.delta[table.step, 2] - table.turn + bias.mean * table.dt)
    off, var, dt = (np.add.reduceat(one, first) for one in (off, log.delta_cov[table.step, 2, 2] + table.var, table.dt))
    walked = np.cumsum(np.add.reduceat(table.walk, first))
    share = float((off**2 > FAR * (var + dt**2 * (bias.sd**2 + walked))).mean())
    if share < OTHER:
        return ""
    before, after = _misfit([fit for _, fit in fits]), _misfit([fitted(part) for part in stretches(_by_turns(log))])
    if before <= MANY or after > min(MANY, before / 3):
        return ""
    return (
        f"the odometry's turns are not the gyro's in {number(100 * share)} % of {len(first)} stretches of time, and "
        f"sightings fit the gyro's ({number(100 * after)} % do not, with the odometry {number(100 * before)} %): "
        f"{CAUSES}"
    )


def _misfit(fits: Sequence[Fitted | None]) -> float:
    """The share of sightings that are far out; 1 where a fit does not succeed."""
    done = [fit for fit in fits if fit is not None]
    if len(done) < len(fits) or not done:
        return 1.0
    squares = np.concatenate([fit.squares for fit in done])
    return float((squares > FAR).mean()) if len(squares) >= FEWEST else 1.0


def _by_turns(log: Log) -> Log:
    """The log with turns by the gyro, where it has some, ways that are free, and without loops closed."""
    table, delta, cov = log.gyro, log.delta.copy(), log.delta_cov.copy()
    assert table is not None
    usual = float(np.sqrt(np.mean(hypot(*delta[1:, :2].T) ** 2)))
    cov[1:] += np.diag([(FREE * usual) ** 2, (FREE * usual) ** 2, 0.0])
    delta[table.step, 2] = wrap(table.turn - table.prior.mean * table.dt)
    cov[table.step, :, 2] = cov[table.step, 2, :] = 0.0
    cov[table.step, 2, 2] = table.var + (table.prior.sd * table.dt) ** 2
    return replace(log, delta=delta, delta_cov=cov, gyro=None).without_loops()
