"""Standard errors and intervals of systematic errors, by the jackknife over stretches of logs."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from ...core.se2 import Array
from ...datasets.noise.systematic import NAMES, Systematic
from .estimated import Estimated
from .reduced import Reduced


def solved(H: Array, g: Array, free: Sequence[str]) -> Array:
    """(p,) the solution of H x = -g, or (b, p) of several, with 0 for what is not free."""
    at = np.array([NAMES.index(name) for name in free], np.int64)
    x = np.zeros(g.shape)
    x[..., at] = -np.linalg.solve(H[..., at[:, None], at], g[..., at, None])[..., 0]
    return x


def standard_errors(joint: Reduced, free: Sequence[str]) -> Array:
    """(p,) by the jackknife; 0 of what is not free."""
    off = solved(joint.H_without, joint.g_without, free)
    b = len(off)
    return np.sqrt((b - 1) / b * ((off - off.mean(axis=0)) ** 2).sum(axis=0))


def degrees(joint: Reduced, free: Sequence[str]) -> Array:
    """(p,) degrees of freedom of the standard errors, where `free`: Satterthwaite's, by what each stretch tells.

    Where few stretches tell of one, as turns do of a delay, the jackknife is a variance of few numbers: with shares
    c of the information, (sum c)^2 / sum c^2 - 1 (Satterthwaite 1946; for clusters Bell and McCaffrey 2002).
    """
    out = np.full(len(NAMES), float(len(joint.g_without) - 1))
    for name in free:
        k, rest = NAMES.index(name), [NAMES.index(other) for other in free if other != name]
        told = np.maximum(_told_of(joint.H, k, rest) - _told_of(joint.H_without, k, rest), 0.0)
        if told.any():
            out[k] = max(told.sum() ** 2 / (told**2).sum() - 1, 1.0)
    return out


def _told_of(H: Array, k: int, rest: list[int]) -> Array:
    """(...) the information of variable k, the `rest` estimated, of systems H (..., p, p)."""
    if not rest:
        return H[..., k, k]
    across, at = H[..., k, rest], np.array(rest)
    return H[..., k, k] - (across * np.linalg.solve(H[..., at[:, None], at], across[..., None])[..., 0]).sum(axis=-1)


def estimates(errors: Systematic, joint: Reduced, free: Sequence[str]) -> dict[str, Estimated]:
    """The errors of `free` with their 95 % intervals, by their names."""
    half = student.ppf(0.975, degrees(joint, free)) * standard_errors(joint, free)
    return {
        name: Estimated(value := getattr(errors, name), value - half[k], value + half[k])
        for k, name in enumerate(NAMES)
        if name in free
    }
