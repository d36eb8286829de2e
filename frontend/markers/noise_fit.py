"""Fits the noise models to the known errors of a recording with ground truth.

Every fit is the maximum likelihood of independent zero-mean Gaussian errors, so a bias counts as noise. Gross outliers
are trimmed: errors beyond `GATE` standard deviations are excluded and the fit is repeated until the same ones stay
excluded; the first fit excludes those far out by the median. Of Gaussian errors that trims one in 16,000. The standard
errors assume independent sightings; those of one marker in successive frames are not quite.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array
from .noise import rocking, rocking_slope

GATE = 4.0
"""Standard deviations; for both coordinates of a sighting together, the chi-square bound of the same probability."""

FEWEST = 20  # fewest sightings to fit a slope and a floor

_GATE_BOTH = 19.33  # -2 log(P(|x| > GATE)), chi-square with 2 degrees of freedom
_ROUNDS = 30
_SWAY = (1e-5, 0.3)  # rad, least and most that is fitted
_LEAST = 1e-4  # of the mean variance, kept by a floor so that no covariance becomes singular

Mask = NDArray[np.bool_]
Fit = TypeVar("Fit")


class Slope(NamedTuple):
    """An error's standard deviation, sd^2 = (k |z|)^2 + floor^2, with the standard errors of k and the floor."""

    k: float
    floor: float
    k_error: float
    floor_error: float
    used: Mask  # (n,) those not trimmed


class Propagated(NamedTuple):
    """A factor on stated standard deviations, added floors and the body's sway, with their standard errors."""

    scale: float
    floors: Array  # (2,) m, rad
    sway: float  # rad; 0 where the heights are not given
    scale_error: float
    floor_errors: Array  # (2,)
    sway_error: float  # 0 where the heights are not given
    used: Mask  # (n,) those not trimmed


def fit_slope(z: Array, errors: Array) -> Slope:
    """Fits k and the floor of ArUco EKF SLAM, eq. (10), to one coordinate's readings `z` (n,) and errors (n,).

    The floor is kept above a hundredth of the typical error, so that the covariance stays valid. InputError for fewer
    than `FEWEST` errors, and where all of them are zero.
    """
    squared = z**2

    def fitted(used: Mask) -> tuple[float, float]:
        return _variance_line(squared[used], errors[used] ** 2)

    def far(line: tuple[float, float]) -> Array:
        return errors**2 / (line[0] * squared + line[1]) / GATE**2

    (a, b), used = _trimmed(fitted, far, np.abs(errors))
    v = a * squared[used] + b
    design = np.stack((squared[used], np.ones(len(v))), axis=-1) / v[:, None]
    a_error, b_error = np.sqrt(np.diag(np.linalg.pinv(design.T @ design / 2)))  # Fisher information of (a, b)
    return Slope(float(np.sqrt(a)), float(np.sqrt(b)), _root_error(a, a_error), _root_error(b, b_error), used)


def fit_propagated(errors: Array, cov: Array, places: Array | None = None) -> Propagated:
    """Fits scale s, floors f and sway w: `errors` (n, 2) have covariances s^2 cov + diag(f^2) + rocking(w, places).

    `cov` is (n, 2, 2), `places` (n, 2) the markers' ranges and heights over the robot's plane, m; without them w is 0.
    Where all markers are at one height and range, floors and sway cannot be told apart; together they hold. The floors
    cover the other errors that do not come from the corners. InputError for fewer than `FEWEST` errors, and where all
    of them are zero.
    """

    def fitted(mine: Mask) -> Array:
        return _variances(errors[mine], cov[mine], None if places is None else places[mine])

    def far(p: Array) -> Array:
        return squares(errors, _spread(p, cov, places)[0]) / _GATE_BOTH

    p, used = _trimmed(fitted, far, np.hypot(*(errors / _typical(errors)).T))
    # Fisher information of the variances: tr(V^-1 dV/da V^-1 dV/db) / 2 per sighting.
    v, slopes = _spread(p, cov, places)
    slopes = np.linalg.solve(v[used], slopes[:, used])
    information = np.einsum("anij,bnji->ab", slopes, slopes) / 2
    unit = np.sqrt(np.diag(information))  # the variances are of different units, and orders of magnitude
    of_variances = np.sqrt(np.diag(np.linalg.pinv(information / np.outer(unit, unit)))) / unit
    found = np.sqrt(p)
    its_error = np.array([_root_error(value, error) for value, error in zip(p, of_variances, strict=True)])
    return Propagated(
        scale=float(found[0]),
        floors=found[1:3],
        sway=float(found[3:].sum()),
        scale_error=float(its_error[0]),
        floor_errors=its_error[1:3],
        sway_error=float(its_error[3:].sum()),
        used=used,
    )


def _spread(p: Array, cov: Array, places: Array | None) -> tuple[Array, Array]:
    """(n, 2, 2) covariances for the variances `p` of scale, both floors and, if there are `places`, sway; and slopes.

    The slopes (len(p), n, 2, 2) are the derivatives by each of `p`.
    """
    axes = np.broadcast_to(np.eye(2)[:, None, :, None] * np.eye(2)[:, None, None, :], (2, *cov.shape))
    slopes = np.concatenate((cov[None], axes))
    v = np.einsum("a,anij->nij", p[:3], slopes)
    if places is None:
        return v, slopes
    v += rocking(np.sqrt(p[3]), *places.T)
    return v, np.concatenate((slopes, rocking_slope(np.sqrt(p[3]), *places.T)[None]))


def squares(errors: Array, cov: Array) -> Array:
    """(n,) normalised squared errors e' C^-1 e of `errors` (n, 2); 2 on average where the covariances are right."""
    return np.einsum("ni,ni->n", errors, np.linalg.solve(cov, errors[:, :, None])[:, :, 0])


def _variance_line(x: Array, squared: Array) -> tuple[float, float]:
    """The maximum-likelihood a, b >= 0 of variances a x + b of zero-mean Gaussian errors with these squares.

    For a given ratio of the two the scale follows in closed form, which leaves a one-dimensional search.
    """
    from scipy.optimize import minimize_scalar

    mean = float(x.mean())
    scaled = x / mean if mean > 0 else np.ones_like(x)

    def size(share: float) -> tuple[float, float]:
        q = share * scaled + (1 - share)
        size = float(np.mean(squared / q))
        return size, float(np.log(size) + np.log(q).mean())

    shares = np.linspace(0, 1 - _LEAST, 41)
    costs = [size(share)[1] for share in shares]
    best = int(np.argmin(costs))
    low, high = shares[max(best - 1, 0)], shares[min(best + 1, len(shares) - 1)]
    close = {"xatol": 1e-7}
    found: Any = minimize_scalar(lambda s: size(s)[1], bounds=(low, high), method="bounded", options=close)
    share = float(found.x) if found.fun < costs[best] else float(shares[best])
    total = size(share)[0]
    return (total * share / mean if mean > 0 else 0.0), total * (1 - share)


def _variances(errors: Array, cov: Array, places: Array | None) -> Array:
    """(3 or 4,) the maximum-likelihood variances of `_spread`, searched in logarithms."""
    from scipy.optimize import minimize

    closed = max(float(squares(errors, cov).mean() / 2), 1e-12)
    total = _typical(errors) ** 2

    def cost(logs: Array) -> tuple[float, Array]:
        p = np.exp(logs)
        v, slopes = _spread(p, cov, places)
        inverse = np.linalg.inv(v)
        whitened = np.einsum("nij,nj->ni", inverse, errors)
        # d cost / dV = V^-1 - V^-1 e e' V^-1
        slope = inverse - whitened[:, :, None] * whitened[:, None, :]
        gradient = np.einsum("nij,anji->a", slope, slopes) / len(errors) * p
        value = np.einsum("ni,ni->n", errors, whitened) + np.linalg.slogdet(v)[1]
        return float(value.mean()), gradient

    least, most = [_LEAST * min(closed, 1.0), *(_LEAST**2 * total)], [2 * closed, *(4 * total)]
    alone, causes = [closed, *total], [0, 1, 1]
    if places is not None:
        by_height = total[0] / max(float((places[:, 1] ** 2).mean()), 1e-12)
        least, most = [*least, _SWAY[0] ** 2], [*most, _SWAY[1] ** 2]
        alone, causes = [*alone, by_height], [*causes, 2]
    low, high = np.log(least), np.log(most)
    # Each start but the last attributes all errors to one cause.
    starts = [np.where(np.equal(causes, cause), np.log(alone), low + 2) for cause in range(causes[-1] + 1)]
    bounds = list(zip(low, high, strict=True))
    found: list[Any] = [
        minimize(cost, np.clip(start, low, high), jac=True, bounds=bounds) for start in (*starts, (low + high) / 2)
    ]
    return np.exp(min(found, key=lambda one: one.fun).x)


def _typical(errors: Array) -> Array:
    """(2,) the root mean square of each coordinate, or 1 where all errors are zero."""
    size = np.sqrt((errors**2).mean(axis=0))
    return np.where(size > 0, size, 1.0)


def _trimmed(fitted: Callable[[Mask], Fit], far: Callable[[Fit], Array], size: Array) -> tuple[Fit, Mask]:
    """Fits repeatedly to those not `far` (beyond 1), excluding at first those of a `size` far from the median."""
    if len(size) < FEWEST:
        raise InputError(f"noise: found {len(size)} sightings with a known error, expected at least {FEWEST}")
    used = size <= 5 * GATE * np.median(size)
    for _ in range(_ROUNDS):
        if not size[used].any():
            raise InputError("noise: found only sightings without error, expected nonzero errors")
        fit = fitted(used)
        now = far(fit) <= 1
        if (now == used).all() or now.sum() < FEWEST:
            return fit, used
        used = now
    return fitted(used), used


def _root_error(variance: float, error: float) -> float:
    """The standard error of a root from that of its square; where the square may be zero, its upper limit."""
    return float(min(error / (2 * np.sqrt(variance)), np.sqrt(error)) if variance > 0 else np.sqrt(error))
