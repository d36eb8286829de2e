"""Motions written otherwise, with the noise that their log would state for them."""

import contextlib
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from ...core.factors import Log
from ...core.se2 import Array

TINY = 1e-300
"""Keeps the size of a term that no motion has from being 0."""

AS_MODELLED = 0.5
"""Root mean square of what the model of noise leaves of the variances, over their mean, up to which it is the log's."""


class MotionNoise:
    """The variances that a log states for its motions, as sums of a constant and shares of way and turn and squares.

    Readers of logs state noise so, for the readings between two steps, which may turn more than their sum. Of other
    logs, such as those of a scan matcher, each motion keeps its covariance, turned as the motion is.
    """

    def __init__(self, log: Log) -> None:
        self._delta, self._cov = log.delta[1:], log.delta_cov[1:]
        terms, variances = _terms(self._delta), np.einsum("nii->ni", self._cov)
        mean, size = np.maximum(variances.mean(axis=0), TINY), np.maximum(terms.max(axis=0), TINY)
        shares = [_fitted(terms / size, column / m) * m for column, m in zip(variances.T, mean, strict=True)]
        self._shares, self._least = np.stack(shares) / size, variances.min(axis=0)
        left = (self._model(self._delta) - variances) / mean
        self.modelled = bool(np.sqrt(np.mean(left**2)) < AS_MODELLED)  # not where one is not a number

    def cov(self, delta: Array) -> Array:
        """(n - 1, 3, 3) covariances of other motions of the steps, (n - 1, 3)."""
        if self.modelled:
            larger = np.sqrt(self._model(delta) / self._model(self._delta))
            return self._cov * larger[:, :, None] * larger[:, None, :]
        angle = np.arctan2(delta[:, 1], delta[:, 0]) - np.arctan2(self._delta[:, 1], self._delta[:, 0])
        c, s, R = np.cos(angle), np.sin(angle), np.zeros((len(delta), 3, 3))
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1.0
        return R @ self._cov @ R.swapaxes(1, 2)

    def _model(self, delta: Array) -> Array:
        """(n - 1, 3) variances, at least the least one that is stated."""
        return np.maximum(_terms(delta) @ self._shares.T, self._least)


def _fitted(terms: Array, values: Array) -> Array:
    """The shares (5,), none negative, of terms (n, 5) nearest to the values (n,); NaN where there are none."""
    if np.isfinite(terms).all() and np.isfinite(values).all():
        with contextlib.suppress(RuntimeError):  # too many iterations
            return nnls(terms, values)[0]
    return np.full(terms.shape[1], np.nan)


def with_motions(log: Log, ways: Array, turns: Array) -> Log:
    """The log with other motions: ways (n - 1, 2) in the body frame before each, and turns (n - 1,)."""
    delta, cov = log.delta.copy(), log.delta_cov.copy()
    delta[1:] = np.column_stack((ways, turns))
    cov[1:] = MotionNoise(log).cov(delta[1:])
    return replace(log, delta=delta, delta_cov=cov)


def _terms(delta: Array) -> Array:
    way, turn = np.hypot(delta[:, 0], delta[:, 1]), np.abs(delta[:, 2])
    return np.stack((np.ones_like(way), way, way**2, turn, turn**2), axis=-1)
