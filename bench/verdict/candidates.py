"""Other intervals of a shift over logs in clusters, which the simulation compares with the one in use.

Each takes logarithms of ratios (n,) and the cluster of each, and returns the ends of a 95 % interval of their mean.
"""

from collections.abc import Hashable, Sequence
from math import sqrt
from statistics import NormalDist

import numpy as np
from scipy.special import stdtrit

from ...core.se2 import Array
from .statistics import LEVEL

RESAMPLES = 999
NORMAL = NormalDist()


def mixed_model(d: Array, clusters: Sequence[Hashable]) -> tuple[float, float]:
    """Computes the interval of a random intercept per cluster, with Satterthwaite's degrees of freedom.

    The variance between clusters is that of the analysis of variance, 0 where it is negative; the logs are then taken
    as independent (Satterthwaite, Biometrics Bulletin 2(6), 1946).
    """
    groups = _groups(d, clusters)
    k, n = len(groups), len(d)
    sizes, means = np.array([len(g) for g in groups]), np.array([g.mean() for g in groups])
    inner = sum(float(((g - g.mean()) ** 2).sum()) for g in groups)
    outer = float((sizes * (means - d.mean()) ** 2).sum())
    within, between = inner / max(n - k, 1), outer / (k - 1)
    if between > within:
        return _around(d.mean(), sqrt(between / n), k - 1)
    return _around(d.mean(), sqrt((inner + outer) / (n - 1) / n), n - 1)


def percentile(d: Array, clusters: Sequence[Hashable]) -> tuple[float, float]:
    """Computes the percentile interval of a bootstrap that draws whole clusters."""
    low, high = np.quantile(_resampled(_groups(d, clusters)), (LEVEL / 2, 1 - LEVEL / 2)).tolist()
    return low, high


def accelerated(d: Array, clusters: Sequence[Hashable]) -> tuple[float, float]:
    """Computes the BCa interval of that bootstrap (Efron, Journal of the American Statistical Association 82, 1987)."""
    groups = _groups(d, clusters)
    drawn = _resampled(groups)
    below = np.clip((drawn < d.mean()).mean(), 1 / (RESAMPLES + 1), RESAMPLES / (RESAMPLES + 1))
    left = np.array([np.concatenate([*groups[:j], *groups[j + 1 :]]).mean() for j in range(len(groups))])
    off = left.mean() - left
    spread = float((off**2).sum()) ** 1.5
    bias, skew = NORMAL.inv_cdf(float(below)), float((off**3).sum()) / (6 * spread) if spread else 0.0
    ends = [bias + z for z in (NORMAL.inv_cdf(LEVEL / 2), NORMAL.inv_cdf(1 - LEVEL / 2))]
    low, high = np.quantile(drawn, [NORMAL.cdf(bias + end / (1 - skew * end)) for end in ends]).tolist()
    return low, high


def _groups(d: Array, clusters: Sequence[Hashable]) -> list[Array]:
    of = np.array([list(dict.fromkeys(clusters)).index(cluster) for cluster in clusters])
    return [d[of == k] for k in range(of.max() + 1)]


def _resampled(groups: Sequence[Array]) -> Array:
    """The means (RESAMPLES,) of clusters drawn with replacement: the same draws each time."""
    drawn = np.random.default_rng(0).integers(0, len(groups), (RESAMPLES, len(groups)))
    sums, sizes = np.array([g.sum() for g in groups]), np.array([len(g) for g in groups])
    return sums[drawn].sum(1) / sizes[drawn].sum(1)


def _around(middle: float, se: float, dof: float) -> tuple[float, float]:
    reach = float(stdtrit(dof, 1 - LEVEL / 2)) * se
    return middle - reach, middle + reach
