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

GATE = 4.0
"""Standard deviations; for both coordinates of a sighting together, the chi-square bound of the same probability."""

FEWEST = 20  # fewest sightings to fit a slope and a floor

_GATE_BOTH = 19.33  # -2 log(P(|x| > GATE)), chi-square with 2 degrees of freedom
_ROUNDS = 30
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
    """A factor on stated standard deviations and added floors, with their standard errors."""

    scale: float
    floors: Array  # (2,) m, rad
    scale_error: float
    floor_errors: Array  # (2,)
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


def fit_propagated(errors: Array, cov: Array) -> Propagated:
    """Fits scale s and floors f: `errors` (n, 2) have covariances s^2 cov + diag(f^2), cov (n, 2, 2).

    The floors cover errors that do not come from the corners, such as a rocking mounting. InputError for fewer than
    `FEWEST` errors, and where all of them are zero.
    """

    def spread(p: Array) -> Array:
        return p[0] * cov + p[1:, None] * np.eye(2)

    def far(p: Array) -> Array:
        return squares(errors, spread(p)) / _GATE_BOTH

    p, used = _trimmed(
        lambda mine: _variance_shares(errors[mine], cov[mine]), far, np.hypot(*(errors / _typical(errors)).T)
    )
    # Fisher information of the three variances: tr(V^-1 dV/da V^-1 dV/db) / 2 per sighting.
    axes = np.broadcast_to(np.eye(2)[:, None, :, None] * np.eye(2)[:, None, None, :], (2, used.sum(), 2, 2))
    slopes = np.linalg.solve(spread(p)[used], np.concatenate((cov[used][None], axes)))
    information = np.einsum("anij,bnji->ab", slopes, slopes) / 2
    variances = np.sqrt(np.diag(np.linalg.pinv(information)))
    scale_error, *floor_errors = (_root_error(value, error) for value, error in zip(p, variances, strict=True))
    return Propagated(float(np.sqrt(p[0])), np.sqrt(p[1:]), scale_error, np.array(floor_errors), used)


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


def _variance_shares(errors: Array, cov: Array) -> Array:
    """(3,) the maximum-likelihood s^2, f_0^2, f_1^2 of covariances s^2 cov + diag(f^2), searched in logarithms."""
    from scipy.optimize import minimize

    closed = max(float(squares(errors, cov).mean() / 2), 1e-12)
    total = _typical(errors) ** 2

    def cost(logs: Array) -> tuple[float, Array]:
        s, *floors = np.exp(logs)
        v = s * cov + np.diag(floors)
        inverse = np.linalg.inv(v)
        whitened = np.einsum("nij,nj->ni", inverse, errors)
        # d cost / dV = V^-1 - V^-1 e e' V^-1
        slope = inverse - whitened[:, :, None] * whitened[:, None, :]
        gradient = [np.einsum("nij,nji->n", slope, cov).mean() * s]
        gradient += [slope[:, axis, axis].mean() * floors[axis] for axis in (0, 1)]
        value = np.einsum("ni,ni->n", errors, whitened) + np.linalg.slogdet(v)[1]
        return float(value.mean()), np.array(gradient)

    least = np.log(np.array([_LEAST * min(closed, 1.0), *(_LEAST**2 * total)]))
    most = np.log(np.array([2 * closed, *(4 * total)]))
    bounds = list(zip(least, most, strict=True))
    # One start attributes all errors to the corners, the other all to the floors.
    starts = (
        np.array([np.log(closed), *(least[1:] + 2)]),
        np.array([least[0] + 2, *np.log(total)]),
        (least + most) / 2,
    )
    found: list[Any] = [minimize(cost, np.clip(s, least, most), jac=True, bounds=bounds) for s in starts]
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
