"""Fits the errors of one kind of measurement: size, growth with range, correlation in time, biases, tails."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ...datasets._information import FIRST, kept
from ...datasets.noise.model import SightingModel
from ..systematic.estimated import Estimated
from ._gauss_markov import innovations, sum_variance
from .likelihood import TWO_SIDED, Maximum, maximum

Mask = NDArray[np.bool_]

FEWEST = 30  # fewest errors for a fit

GROSS = 6.0
"""Standard deviations, of all parts together, beyond which an error is an outlier: one normal error in 5e8 is."""

SURE = {1: 10.83, 2: 13.82}
"""Twice the gain in log-likelihood from which on so many parameters more are needed: chi-square's 99.9 % point."""

IN_A_ROW = 12
"""Sightings of a landmark in a row whose information is compared with that of independent ones."""

TOO_LARGE = 2.5
"""Times the errors' mean square from which on a fitted variance is refused.

Where the model does not hold, large parts of opposite sign can explain how errors change, and not how large they are.
"""

_ROUNDS = 8
_ROBUST = 1.4826  # a normal standard deviation over the median of absolute values
_LOGIT = 7.0  # of the shares fitted: 0.001 to 0.999
_FLAT = 0.1  # range of logarithms of distances below which no power of the distance is fitted


class Chains(NamedTuple):
    """Errors with their stated standard deviations, chain after chain, each in order of time."""

    error: Array  # (n,)
    stated: Array  # (n,)
    reach: Array  # (n,) distance of the landmark, m
    gap: Array  # (n,) s since the error before in the chain; inf for a chain's first


class Correlation(NamedTuple):
    """The part of an error that is correlated in time."""

    time: Estimated  # s in which it falls to 1 / e
    share: Estimated  # of the variance


class Fitted(NamedTuple):
    """The noise of one kind of measurement."""

    used: Mask  # (n,) the errors that are no outliers
    scale: Estimated  # times the stated standard deviation, at the distance `reach`
    sd: Estimated  # there, of the typical stated one
    power: Estimated | None  # the standard deviation grows with this power of the distance more than stated
    reach: float  # m, the typical distance
    mean: Estimated  # of all errors
    correlation: Correlation | None  # None: none was found
    bias: Estimated | None  # the biases' standard deviation, one per landmark; None: none was found
    white: Array  # (u,) the used errors' innovations over their standard deviations: white where the model is right
    tails: Estimated | None  # Student's degrees of freedom of `white`; None: normal
    outliers: Estimated  # their share
    gap: float  # s, the typical time between sightings of a landmark in a row

    def model(self, together: float) -> SightingModel:
        """The fitted numbers, with the correlation between landmarks sighted at one step."""
        share, time = (0.0, 1.0) if self.correlation is None else (c.value for c in reversed(self.correlation))
        power = 0.0 if self.power is None else self.power.value
        bias = 0.0 if self.bias is None else self.bias.value
        return SightingModel(self.scale.value, power, self.reach, bias, share, time, together)

    @property
    def in_a_row(self) -> float:
        """The number of independent sightings with the information of IN_A_ROW in a row."""
        one = self.model(0.0)
        keep = np.full(IN_A_ROW, np.exp(-self.gap / one.time))
        keep[0] = FIRST
        return IN_A_ROW * kept(keep, one.share)


def fitted(chains: Chains) -> Fitted | None:
    """Fits all parameters by maximum likelihood, those alone that the errors ask for; None for too few errors."""
    if len(chains.error) < FEWEST:
        return None
    used = _near(chains.error / chains.stated)
    found = None
    for _ in range(_ROUNDS):
        if used.sum() < FEWEST or not chains.error[used].any():
            return None
        found, scaled = _fitted(chains, used)
        now = np.abs(scaled) <= GROSS
        if (now == used).all():
            break
        used = now
    return found


def _near(scaled: Array) -> Mask:
    """Errors within twice `GROSS` of a robust spread: a start that outliers do not move."""
    typical = _ROBUST * float(np.median(np.abs(scaled)))
    return np.abs(scaled) <= 2 * GROSS * max(typical, 1e-300)


class _Parts(NamedTuple):
    """Which parts an error has, beside white noise."""

    growing: bool
    correlated: bool
    biased: bool

    @property
    def price(self) -> float:
        """The gain in log-likelihood from which on they are needed."""
        return (SURE[2] * self.correlated + SURE[1] * self.biased) / 2

    @property
    def bounds(self) -> Array:
        """Start, least and largest value (3, p) of every parameter, the logarithm of the scale's being last."""
        parts = [(0.0, -5.0, 5.0)] * self.growing
        parts += [(0.0, -_LOGIT, _LOGIT), (np.log(2.0), np.log(1e-3), np.log(1e5))] * self.correlated
        return np.array([*parts, *[(np.log(0.3), np.log(1e-3), np.log(10.0))] * self.biased, (0.0, -5.0, 5.0)]).T


class _Values(NamedTuple):
    scale: float  # times `_Errors.size`
    power: float
    share: float
    time: float
    bias: float


class _Errors:
    """The used errors of chains, and their likelihood."""

    def __init__(self, chains: Chains, used: Mask) -> None:
        self.gap, self.error, self.stated = closed(chains.gap, used), chains.error[used], chains.stated[used]
        self.unit = float(np.sqrt(np.mean(self.error**2)))
        self.size = float(np.sqrt(np.mean((self.error / self.stated) ** 2)))
        self.reach = float(np.exp(np.mean(np.log(chains.reach[used]))))
        self.far = np.log(chains.reach[used] / self.reach)

    def values(self, parts: _Parts, p: Array) -> _Values:
        """The parameters as they are."""
        rest = iter(p.tolist())
        power = next(rest) if parts.growing else 0.0
        share, time = (_share(next(rest)), _exp(next(rest))) if parts.correlated else (0.0, 1.0)
        bias = self.unit * _exp(next(rest)) if parts.biased else 0.0
        return _Values(_exp(next(rest)), power, share, time, bias)

    def filtered(self, v: _Values) -> tuple[Array, Array]:
        """Innovations and their variances."""
        return innovations(self.error, self.spread(v), self.gap, v.share, v.time, v.bias)

    def spread(self, v: _Values) -> Array:
        """Standard deviations without biases."""
        return self.size * v.scale * self.stated * np.exp(v.power * self.far)

    def fair(self, v: _Values) -> bool:
        """True where the fitted variance is about the errors' own."""
        ratio = float(np.mean(self.error**2 / (self.spread(v) ** 2 + v.bias**2)))
        return 1 / TOO_LARGE < ratio < TOO_LARGE

    def solved(self, parts: _Parts) -> Maximum:
        """The maximum of the likelihood."""

        def log_likelihood(p: Array) -> float:
            e, v = self.filtered(self.values(parts, p))
            return -0.5 * float(np.sum(e * e / v) + np.sum(np.log(v)))

        return maximum(log_likelihood, *parts.bounds)


def _fitted(chains: Chains, used: Mask) -> tuple[Fitted, Array]:
    """The noise of the used errors, and all errors over their standard deviations."""
    errors = _Errors(chains, used)
    growing = int(np.ptp(errors.far) > _FLAT)
    wider = ((False, False), (True, False), (False, True), (True, True))
    all_parts = [_Parts(growing > 0, *more) for more in wider]
    solved = [(one, errors.solved(one)) for one in all_parts]
    fair = [(one, best) for one, best in solved if errors.fair(errors.values(one, best.at))]
    parts, best = max(fair or solved[:1], key=lambda found: found[1].value - found[0].price)
    v = errors.values(parts, best.at)
    e, variance = errors.filtered(v)
    white = e / np.sqrt(variance)
    typical = float(np.exp(np.mean(np.log(errors.stated))))
    correlation = None
    if parts.correlated:
        correlation = Correlation(best.estimate(growing + 1, _exp), best.estimate(growing, _share))
    bias = best.estimate(len(best.at) - 2, lambda p: errors.unit * _exp(p)) if parts.biased else None
    total = sum_variance(errors.spread(v), errors.gap, v.share, v.time, v.bias)
    between = errors.gap[np.isfinite(errors.gap)]
    scale = best.estimate(len(best.at) - 1, lambda p: errors.size * _exp(p))
    found = Fitted(
        used,
        scale,
        Estimated(*(typical * one for one in scale)),
        best.estimate(0) if growing else None,
        errors.reach,
        _mean(errors.error, total),
        correlation,
        bias,
        white,
        _tails(white),
        share_of(int((~used).sum()), len(used)),
        float(np.median(between)) if len(between) else np.inf,
    )
    spread = found.model(0.0).spread(chains.stated, chains.reach)
    return found, chains.error / np.hypot(spread, v.bias)


def closed(gap: Array, used: Mask) -> Array:
    """The gaps of the used errors: those of errors left out are added to the next one's."""
    total = np.cumsum(np.where(np.isinf(gap), 0.0, gap))
    chain = np.cumsum(np.isinf(gap))[used]
    since = np.diff(total[used], prepend=0.0)
    since[np.diff(chain, prepend=-1) != 0] = np.inf
    return since


def _tails(white: Array) -> Estimated | None:
    """Student's degrees of freedom, if the tails are significantly heavier than normal ones."""
    from scipy.special import gammaln

    unit = float(np.sqrt(np.mean(white**2)))

    def log_likelihood(p: Array) -> float:
        nu, size = np.exp(p[0]), unit * np.exp(p[1])
        constant = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(np.pi * nu) - np.log(size)
        return float(len(white) * constant - (nu + 1) / 2 * np.log1p((white / size) ** 2 / nu).sum())

    best = maximum(log_likelihood, np.log([5.0, 0.8]), np.log([0.5, 0.01]), np.log([1000.0, 10.0]))
    normal = -0.5 * len(white) * float(1 + np.log(2 * np.pi * unit**2))
    return best.estimate(0, _exp) if 2 * (best.value - normal) > SURE[1] else None


def _mean(error: Array, variance: float) -> Estimated:
    """The mean of errors (n,) whose sum has this variance."""
    middle, half = float(error.mean()), TWO_SIDED * float(np.sqrt(variance)) / len(error)
    return Estimated(middle, middle - half, middle + half)


def share_of(count: int, total: int) -> Estimated:
    """A share with Wilson's interval."""
    z, p = TWO_SIDED, count / total
    middle = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2))
    return Estimated(p, min(p, float(middle - half)) if count else 0.0, float(middle + half))


def _exp(p: float) -> float:
    return float(np.exp(p))


def _share(p: float) -> float:
    return float(1 / (1 + np.exp(-p)))
