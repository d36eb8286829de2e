"""The inner loops of `ukf.py`: the unscented transform of each of the three models, and what it does to the root.

The belief: pose (3,), landmarks' mean (n,) and the root of their joint covariance, the landmarks' rows packed (see
`_root.py`), the pose's three rows (3, n + 3) apart. Logically the pose comes last: a motion then changes its rows only.
A transform takes x = mean + root xi, xi ~ N(0, 1), over the few coordinates x that a model depends on, and returns it
as a regression on xi: slope, shift of the mean, and the covariance of what a line leaves over.
"""

from math import sqrt

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from .._models import moved, placed, sighted, wrap
from ._root import OWED, cholesky, entry, fold, plan, scan, triangularise, unturn

WRONG = ("nothing", "an innovation", "a new landmark")
"""Whose covariance is not positive definite, by the number that `take` returns."""


@compiled
def regress(
    ahead: Array, behind: Array, dims: int, outs: int, spread: float, excess: float
) -> tuple[Array, Array, Array]:
    """The regression of a model on xi from its values at +-sqrt(spread) along each xi, less that at the mean.

    `ahead` and `behind` are (dims, outs); `excess` is beta - alpha^2. Returns slope (outs, dims), shift (outs,) and
    the covariance of the rest (outs, outs). In these sums and differences the scaled unscented transform's mean is
    shift, and its covariance slope slope' + rest, whatever alpha, beta and kappa.
    """
    slope, shift, rest = np.empty((outs, dims)), np.zeros(outs), np.empty((outs, outs))
    for i in range(outs):
        for k in range(dims):
            slope[i, k] = (ahead[k, i] - behind[k, i]) / (2.0 * sqrt(spread))
            shift[i] += (ahead[k, i] + behind[k, i]) / (2.0 * spread)
    for i in range(outs):
        for j in range(outs):
            total = excess * shift[i] * shift[j]
            for k in range(dims):
                total += (ahead[k, i] + behind[k, i]) * (ahead[k, j] + behind[k, j]) / (4.0 * spread)
            rest[i, j] = total
    return slope, shift, rest


@compiled
def copy(source: Array, start: int, target: Array, at: int, count: int, width: int) -> None:
    """target[i, at + j] = source[i, start + j] for i < count, j < width."""
    for i in range(count):
        for j in range(width):
            target[i, at + j] = source[i, start + j]


@compiled
def move(pose: Array, rows: Array, n: int, delta: Array, cov: Array, scaling: Array, work: Array) -> bool:
    """Predict: pose (3,) and its rows of the root after the motion `delta` (3,) with noise `cov` (3, 3).

    False where a covariance is not positive definite. `scaling` holds alpha^2, kappa and beta - alpha^2.
    """
    width, spread = n + 3, scaling[0] * (6.0 + scaling[1])
    root, noise, scale = np.empty((3, 3)), np.empty((3, 3)), np.empty(5)
    copy(rows, 0, work, 0, 3, width)
    triangularise(work, 3, width, scale, root)
    if not cholesky(cov, noise, 3):
        return False
    x, y, heading = moved(pose[0], pose[1], pose[2], delta[0], delta[1], delta[2])
    away = np.empty((2, 6, 3))
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        p, d = np.empty(3), np.empty(3)
        for k in range(6):
            for i in range(3):
                p[i] = pose[i] + (far * root[i, k] if k < 3 else 0.0)
                d[i] = delta[i] + (far * noise[i, k - 3] if k >= 3 else 0.0)
            u, v, turned = moved(p[0], p[1], p[2], d[0], d[1], d[2])
            away[side, k, 0], away[side, k, 1], away[side, k, 2] = u - x, v - y, wrap(turned - heading)
    slope, shift, rest = regress(away[0], away[1], 6, 3, spread, scaling[2])
    pose[0], pose[1], pose[2] = x + shift[0], y + shift[1], wrap(heading + shift[2])
    for i in range(3):
        for j in range(3):
            for k in range(3, 6):
                rest[i, j] += slope[i, k] * slope[j, k]
    if not cholesky(rest, noise, 3):
        return False
    end = np.empty((3, 6))
    for i in range(3):
        for j in range(3):
            rows[i, j] = slope[i, j]
        unturn(rows[i], work, 3, width, scale)
    copy(rows, n, end, 0, 3, 3)
    copy(noise, 0, end, 3, 3, 3)
    triangularise(end, 3, 6, scale, root)
    copy(root, 0, rows, n, 3, 3)
    return True


@compiled
def correct(
    pose: Array,
    rows: Array,
    n: int,
    landmark: Array,
    z: Array,
    R: Array,
    scaling: Array,
    work: Array,
    scans: Array,
    gains: Array,
    owed: int,
) -> float:
    """Correct by a sighting of a landmark whose mean is `landmark` (2,) and whose rows of the root are work[3:5].

    The pose and its rows are corrected at once; scans `owed` and `owed + 1`, with their gains, are written down for the
    others. Returns the normalised innovation squared, or -1 where its covariance is not positive definite.
    """
    width, spread = n + 3, scaling[0] * (5.0 + scaling[1])
    root, scale = np.empty((5, 5)), np.empty(5)
    copy(rows, 0, work, 0, 3, width)
    triangularise(work, 5, width, scale, root)
    r, bearing = sighted(pose[0], pose[1], pose[2], landmark[0], landmark[1])
    away = np.empty((2, 5, 2))
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        for k in range(5):
            s, b = sighted(
                pose[0] + far * root[0, k],
                pose[1] + far * root[1, k],
                pose[2] + far * root[2, k],
                landmark[0] + far * root[3, k],
                landmark[1] + far * root[4, k],
            )
            away[side, k, 0], away[side, k, 1] = s - r, wrap(b - bearing)
    slope, shift, rest = regress(away[0], away[1], 5, 2, spread, scaling[2])
    noise = np.empty((2, 2))
    for i in range(2):
        for j in range(2):
            rest[i, j] += R[i, j]
    if not cholesky(rest, noise, 2):
        return -1.0
    nu = np.empty(2)
    nu[0] = z[0] - r - shift[0]
    nu[1] = wrap(z[1] - bearing - shift[1])
    nu[0] /= noise[0, 0]
    nu[1] = (nu[1] - noise[1, 0] * nu[0]) / noise[1, 1]
    f = work[5:7]
    for k in range(5):
        f[0, k] = slope[0, k] / noise[0, 0]
        f[1, k] = (slope[1, k] - noise[1, 0] * f[0, k]) / noise[1, 1]
    unturn(f[0], work, 5, width, scale)
    unturn(f[1], work, 5, width, scale)
    nis = 0.0
    for m in range(2):
        variance = plan(f[m], width, scans, owed + m)
        gain = nu[m] / variance
        gains[owed + m] = gain
        nis += nu[m] * gain
        if m == 0:
            nu[1] -= scan(f[1], width, scans, owed) * gain
        for i in range(3):
            pose[i] += scan(rows[i], width, scans, owed + m) * gain
    pose[2] = wrap(pose[2])
    return nis


@compiled
def add(
    pose: Array, rows: Array, packed: Array, mean: Array, n: int, z: Array, R: Array, scaling: Array, work: Array
) -> bool:
    """Add the landmark that the pose sees at `z` (2,): its two rows go before the pose's; False as in `move`."""
    width, spread = n + 3, scaling[0] * (5.0 + scaling[1])
    root, noise, scale = np.empty((5, 5)), np.empty((2, 2)), np.empty(5)
    copy(rows, 0, work, 0, 3, width)
    triangularise(work, 3, width, scale, root)
    if not cholesky(R, noise, 2):
        return False
    x, y = placed(pose[0], pose[1], pose[2], z[0], z[1])
    away = np.empty((2, 5, 2))
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        p, m = np.empty(3), np.empty(2)
        for k in range(5):
            for i in range(3):
                p[i] = pose[i] + (far * root[i, k] if k < 3 else 0.0)
            for i in range(2):
                m[i] = z[i] + (far * noise[i, k - 3] if k >= 3 else 0.0)
            u, v = placed(p[0], p[1], p[2], m[0], m[1])
            away[side, k, 0], away[side, k, 1] = u - x, v - y
    slope, shift, rest = regress(away[0], away[1], 5, 2, spread, scaling[2])
    mean[n], mean[n + 1] = x + shift[0], y + shift[1]
    for i in range(2):
        for j in range(2):
            rest[i, j] += slope[i, 3] * slope[j, 3] + slope[i, 4] * slope[j, 4]
    if not cholesky(rest, noise, 2):
        return False
    end = np.zeros((5, 5))
    for i in range(2):
        row = work[5 + i]
        for j in range(3):
            row[j] = slope[i, j]
        unturn(row, work, 3, width, scale)
        for j in range(n):
            packed[entry(n + i, j)] = row[j]
        for j in range(3):
            end[i, j] = row[n + j]
    copy(noise, 0, end, 3, 2, 2)
    copy(rows, n, end[2:], 0, 3, 3)
    triangularise(end, 5, 5, scale, root)
    packed[entry(n, n)] = root[0, 0]
    packed[entry(n + 1, n)] = root[1, 0]
    packed[entry(n + 1, n + 1)] = root[1, 1]
    copy(root[2:], 0, rows, n, 3, 5)
    return True


@compiled
def gather(packed: Array, mean: Array, at: int, n: int, scans: Array, gains: Array, owed: int, work: Array) -> Array:
    """The mean (2,) of the landmark at row `at`, and its rows in work[3:5], as they are once what is owed is made."""
    landmark = np.empty(2)
    for i in range(2):
        row, length = work[3 + i], at + i + 1
        for j in range(length):
            row[j] = packed[entry(at + i, j)]
        for j in range(length, n + 3):
            row[j] = 0.0
        landmark[i] = mean[at + i]
        for m in range(owed):
            landmark[i] += scan(row, length, scans, m) * gains[m]
    return landmark


@compiled
def take(
    pose: Array,
    rows: Array,
    packed: Array,
    mean: Array,
    n: int,
    known: Array,
    slots: Ints,
    z: Array,
    R: Array,
    scaling: Array,
    work: Array,
    scans: Array,
    gains: Array,
    nis: Array,
) -> tuple[int, int]:
    """Take k sightings in their order: z (k, 2), R (k, 2, 2).

    slots[i] is the landmark's number, -1 for a new one, -2 - j for number j of those in `known` (., 2), held fixed.
    Their normalised innovations squared go to `nis` (k,), -1 for none. Returns n afterwards, and what went wrong.
    """
    owed = 0
    for i in range(len(slots)):
        nis[i] = -1.0
        if slots[i] == -1:
            fold(packed, mean, n, scans, gains, owed)
            owed = 0
            if not add(pose, rows, packed, mean, n, z[i], R[i], scaling, work):
                return n, 2
            n += 2
            continue
        if slots[i] >= 0:
            landmark = gather(packed, mean, 2 * slots[i], n, scans, gains, owed, work)
        else:
            landmark = known[-2 - slots[i]]
            for j in range(n + 3):
                work[3, j], work[4, j] = 0.0, 0.0
        nis[i] = correct(pose, rows, n, landmark, z[i], R[i], scaling, work, scans, gains, owed)
        if not nis[i] >= 0.0:
            return n, 1
        owed += 2
        if owed == OWED:
            fold(packed, mean, n, scans, gains, owed)
            owed = 0
    fold(packed, mean, n, scans, gains, owed)
    return n, 0
