"""Residuals of all a log's partial sightings and fixes, and the constant errors of its sensors that fit them best."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from ..core.factors import UNKNOWN, Log, Map
from ..core.fixes import FixTable, information
from ..core.gyro import Gyro
from ..core.partial import RANGE, PartialTable
from ..core.se2 import Array, Ints, act, wrap
from ..core.truth.errors import rows_of
from .api import Constant

TURNS = 3
"""Fits of a heading's offset, each with residuals wrapped at the one before."""


class Ranges(NamedTuple):
    """Ranges alone, whose residual is (1 + scale) d + offset - z."""

    rows: Ints  # (k,) of the table
    landmark: Ints  # (k,) row in the map
    distance: Array  # (k,) m


def partial_residuals(log: Log, path: Array, landmarks: Map, constant: Constant) -> Array | None:
    """(p,) expected minus measured (m or rad) of each partial sighting; NaN without an id.

    None where a landmark is not mapped.
    """
    table = log.partial
    if table is None:
        return np.zeros(0)
    row, off, known = rows_of(landmarks.ids, table.ids), np.full(len(table), np.nan), table.ids != UNKNOWN
    if (row[known] < 0).any():
        return None
    dx, dy = (landmarks.xy[row[known]] - path[table.step[known], :2]).T
    scale, offset = (_of_each(one, row[known]) for one in (constant.range_scale, constant.range_offset))
    ranges = (1 + scale) * np.hypot(dx, dy) + offset - table.z[known]
    bearings = wrap(np.arctan2(dy, dx) - path[table.step[known], 2] - table.z[known])
    off[known] = np.where(table.kind[known] == RANGE, ranges, bearings)
    return off


HELD = 1e-9
"""rad/s, the standard deviation of a bias that is known."""


def turn_cost(gyro: Gyro, path: Array) -> float:
    """The term of J of a gyro's turns along a path (n, 3): turns, walk and prior, with the biases that fit best."""
    bias, off = fitted_biases(gyro, path), _turned(gyro, path)
    turns = (np.square(off - bias[gyro.knot] * gyro.dt) / gyro.var).sum()
    walks = (np.square(np.diff(bias)) / _walks(gyro)).sum()
    return float(turns + walks + (bias[0] - gyro.prior.mean) ** 2 * _first(gyro))


def fitted_biases(gyro: Gyro, path: Array) -> Array:
    """(b,) rad/s, the biases of a gyro with the least J along a path (n, 3): a tridiagonal system."""
    knot, off, walk = gyro.knot, _turned(gyro, path), 1 / _walks(gyro)
    n = int(knot[-1]) + 1
    band, right = np.zeros((2, n)), np.bincount(knot, gyro.dt * off / gyro.var, n)
    band[1] = np.bincount(knot, gyro.dt**2 / gyro.var, n)
    band[1, :-1] += walk
    band[1, 1:] += walk
    band[0, 1:] = -walk
    band[1, 0] += _first(gyro)
    right[0] += gyro.prior.mean * _first(gyro)
    return solveh_banded(band, right) if n > 1 else right / band[1]  # LAPACK refuses a system of one


def _turned(gyro: Gyro, path: Array) -> Array:
    """(n,) rad, what each turn has too much."""
    return wrap(gyro.turn - (path[gyro.step, 2] - path[gyro.step - 1, 2]))


def _walks(gyro: Gyro) -> Array:
    """(b - 1,) variances of the biases' moves."""
    return gyro.walk[np.flatnonzero(np.diff(gyro.knot)) + 1]


def _first(gyro: Gyro) -> float:
    """The information about the first bias."""
    return 1 / max(gyro.prior.sd**2 + float(gyro.walk[0]), HELD**2)


def fix_residuals(table: FixTable, path: Array, constant: Constant) -> Array:
    """(f, 3) expected minus measured of each fix; 0 where nothing is measured."""
    poses = path[table.step]
    expected = np.column_stack((act(poses, table.arm), poses[:, 2] + constant.heading_offset))
    off = np.where(np.isnan(table.z), 0.0, expected - table.z)
    off[:, 2] = wrap(off[:, 2])
    return off


def prior_cost(log: Log, constant: Constant) -> float:
    """The constant errors' term of J: the sum of their squares in their prior standard deviations."""
    sds = log.prior.systematic
    pairs = ((constant.range_scale, sds[0]), (constant.range_offset, sds[1]), (constant.heading_offset, sds[2]))
    return float(sum((np.square(value) / sd**2).sum() for value, sd in pairs if sd > 0))


def fitted(log: Log, path: Array, landmarks: Map) -> Constant:
    """The constant errors with the least J given a path and a map; they enter residuals linearly.

    Zero where the prior has none. Landmarks that are not on the map are passed over.
    """
    sds, table = log.prior.systematic, log.partial
    size = len(landmarks.ids) if sds.each else 1
    scale, offset = np.zeros(size), np.zeros(size)
    if table is not None and (sds.range_scale > 0 or sds.range_offset > 0):
        row = rows_of(landmarks.ids, table.ids)
        rows = np.flatnonzero((row >= 0) & (table.kind == RANGE) & (table.ids != UNKNOWN))
        d = np.hypot(*(landmarks.xy[row[rows]] - path[table.step[rows], :2]).T)
        scale, offset = _line(d, table.z[rows] - d, 1 / table.var[rows], row[rows] if sds.each else 0 * rows, size, sds)
    return Constant(scale, offset, _turn(log, path))


def _line(
    d: Array, excess: Array, weight: Array, group: Ints, groups: int, sds: tuple[float, ...]
) -> tuple[Array, Array]:
    """Scale and offset (groups,) of ranges that exceed distances d by scale d + offset, with their priors."""
    total = [np.bincount(group, weight * one, groups) for one in (d * d, d, np.ones_like(d), d * excess, excess)]
    known = np.array((sds[0] > 0, sds[1] > 0))
    normal = np.empty((groups, 2, 2))
    normal[:, 0, 0], normal[:, 1, 1] = total[0], total[2]
    normal[:, 0, 1] = normal[:, 1, 0] = total[1]
    normal[:, known, known] += [1 / sd**2 for sd in sds[:2] if sd > 0]
    out = np.zeros((groups, 2))
    out[:, known] = np.linalg.solve(normal[:, known][:, :, known], np.stack(total[3:], axis=-1)[:, known, None])[..., 0]
    return out[:, 0], out[:, 1]


def _turn(log: Log, path: Array) -> float:
    """A heading's constant error."""
    table, sd = log.fixes, log.prior.systematic.heading_offset
    turn = 0.0
    if table is None or not sd > 0:
        return turn
    W = information(table.cov)
    for _ in range(TURNS):
        off = fix_residuals(table, path, Constant(np.zeros(1), np.zeros(1), turn))
        measured = W[:, 2, 2] > 0
        pull = (W[measured, 2] * off[measured]).sum() + turn / sd**2
        turn -= float(pull / (W[measured, 2, 2].sum() + 1 / sd**2))
    return turn


def _of_each(values: Array, row: Ints) -> Array:
    """The value of each row's landmark: one for all, or one of each."""
    return values[row] if len(values) > 1 else np.broadcast_to(values, row.shape)


CovOf = Callable[[Ints], Array | None]
"""The joint covariance (2k, 2k) of k variables of two entries; None where it is not known."""


def stated(cov_of: CovOf, variables: Sequence[int], priors: Sequence[Sequence[float]]) -> Constant | None:
    """The standard deviations of the errors of k ranges, and of a heading, in these k + 1 variables.

    A variable that is not there has those of its prior; one that the prior holds at zero has 0.
    """
    sds, there = np.array(priors), np.flatnonzero(np.array(variables) >= 0)
    moving = there[sds[there].any(axis=1)]
    if len(moving):
        cov = cov_of(np.array(variables, np.int64)[moving])
        if cov is None:
            return None
        sds[moving] = np.where(sds[moving] > 0, np.sqrt(np.diagonal(cov)).reshape(-1, 2), 0.0)
    return Constant(sds[:-1, 0], sds[:-1, 1], float(sds[-1, 0]))


def squared_partial(table: PartialTable, off: Array) -> Array:
    """(p,) squared Mahalanobis distances of partial sightings with residuals `off` (p,)."""
    return off**2 / table.var


def squared_fixes(table: FixTable, off: Array) -> Array:
    """(f,) likewise of fixes, off (f, 3)."""
    return np.einsum("ni,nij,nj->n", off, information(table.cov), off)
