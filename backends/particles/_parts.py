"""Scalar measurements of particles: a range or a bearing alone, and the whitened entries of a fix.

Constant errors of ranges are Gaussian in every particle, s = (scale, offset) of mean and covariance S: all landmarks'
together, or each landmark's own. Given them and the path landmarks are independent, so that the joint belief of n
landmarks and s is exactly

    p(s) p(m1 | s) ... p(mn | s),    m | s ~ N(a + B s, C)

and a measurement of one landmark changes two factors of it. With h its derivative by the landmark, e its error at the
means, g = B' h + its derivative by s, and R its variance,

    c = h' C h + R,  u = c + g' S g,  k = C h / c:    a + k (e + g' s),  B - k g',  C - c k k',
    s + S g e / u,  S - S g g' S / u,    -2 log-likelihood + constant = e^2 / u + log u

Columns of a landmark's filter: a (x, y), C (xx, xy, yy), and where ranges have constant errors B (x by scale, x by
offset, y by scale, y by offset) and, of each landmark, its own scale, offset, and their S (ss, so, oo).

In version 2 of FastSLAM the measurement first corrects the proposal: the landmark and s count as noise of variance u,
and A, as in `_proposal.py`, is corrected by Potter's formula, A - A f f' / (v + (u v)^1/2) with v = u + f' f, f = A' g.
"""

from math import inf, log, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._loops import Loops, fold_loops
from ._particles import BLOCK, arctan2, cosine_sine
from ._proposal import ROWS, Motion, draw, fold_all, predict

Flags = NDArray[np.bool]

SLOPES = 5
"""First of the columns that landmarks have where ranges have constant errors: B."""

OWN = 9
"""First of those of a landmark's own constant errors."""

WIDE = 14
"""Columns of a landmark where ranges have constant errors."""


class Parts(NamedTuple):
    """k sightings, each the sum of a range's and a bearing's error times its `share`."""

    slots: Ints  # (k,) of the landmark
    z: Array  # (k, 2) range (m), bearing (rad)
    share: Array  # (k, 2)
    var: Array  # (k,)
    constant: Array  # (k,) 1 where the range has constant errors, else 0
    gate: Array  # (k,) squared distance beyond which one is refused
    refused: Flags  # (k, M) receives where it was


class Whitened(NamedTuple):
    """f fixes of the pose, with the root of the information by which their errors become independent, of variance 1."""

    z: Array  # (f, 3), 0 where nothing is measured
    arm: Array  # (f, 2)
    root: Array  # (f, 3, 3), 0 in the columns of what is not measured
    gate: Array  # (f,)
    refused: Flags  # (f, M) receives where it was refused


@compiled
def sensed(
    dx: float, dy: float, heading: float, scale: float, offset: float, z: Array, share: Array
) -> tuple[float, float, float, float, float, float]:
    """The error of a sighting of a landmark at (dx, dy) from the robot, and derivatives of its expectation.

    These are by the landmark's x and y, the heading, the scale and the offset. The error is infinite at the robot.
    """
    q = dx * dx + dy * dy
    if not q > 0.0:
        return inf, 0.0, 0.0, 0.0, 0.0, 0.0
    r, a, b = sqrt(q), share[0], share[1]
    error, stretch = 0.0, a * (1.0 + scale) / r
    if a != 0.0:
        error += a * (z[0] - (1.0 + scale) * r - offset)
    if b != 0.0:
        error += b * wrap(z[1] - arctan2(dy, dx) + heading)
    return error, stretch * dx - b * dy / q, stretch * dy + b * dx / q, -b, a * r, a


@compiled
def errors_of(
    filters: Array, slot: int, at: int, common: Array, each: bool, m: int
) -> tuple[float, float, float, float, float]:
    """The constant errors of particle m: a landmark's own, in columns from `at` on, or those `common` (5, M) to all."""
    if each:
        own = filters[slot]
        return own[at, m], own[at + 1, m], own[at + 2, m], own[at + 3, m], own[at + 4, m]
    return common[0, m], common[1, m], common[2, m], common[3, m], common[4, m]


@compiled
def put_errors(
    filters: Array, slot: int, at: int, common: Array, each: bool, m: int, values: tuple[float, ...]
) -> None:
    """Stores what `errors_of` reads."""
    for i in range(5):
        if each:
            filters[slot, at + i, m] = values[i]
        else:
            common[i, m] = values[i]


@compiled
def slopes_of(filters: Array, slot: int, m: int) -> tuple[float, float, float, float]:
    """A landmark's B; 0 where its filter has none."""
    if filters.shape[1] == SLOPES:
        return 0.0, 0.0, 0.0, 0.0
    own = filters[slot]
    return own[SLOPES, m], own[SLOPES + 1, m], own[SLOPES + 2, m], own[SLOPES + 3, m]


@compiled
def gains(
    C: tuple[float, float, float], B: tuple[float, float, float, float], S: tuple[float, float, float], hx: float,
    hy: float, hs: float, ho: float, var: float,
) -> tuple[float, float, float, float, float, float, float, float]:  # fmt: skip
    """c, u, C h, g and S g: see above."""
    px, py = C[0] * hx + C[1] * hy, C[1] * hx + C[2] * hy
    g0, g1 = B[0] * hx + B[2] * hy + hs, B[1] * hx + B[3] * hy + ho
    t0, t1 = S[0] * g0 + S[1] * g1, S[1] * g0 + S[2] * g1
    c = hx * px + hy * py + var
    return c, c + g0 * t0 + g1 * t1, px, py, g0, g1, t0, t1


# The sighting comes as its numbers, as to `_rings.respond`, and with what the proposal has decided on it.
@compiled
def correct(
    poses: Array, filters: Array, slot: int, common: Array, each: bool, z: Array, share: Array, var: float,
    constant: float, gate: float, folded: bool, refused: Flags, distance: Array,
) -> None:  # fmt: skip
    """Corrects a landmark and the constant errors by one sighting, and adds -2 log-likelihood to `distance` (M,).

    One that has been `folded` into the proposal is weighted already, and `refused` (M,) says where it was; otherwise
    that is decided here. A refused one is as unlikely as one at the gate.
    """
    wide = filters.shape[1] > SLOPES
    for m in range(poses.shape[1]):
        if folded and refused[m]:
            continue
        scale, offset, ss, so, oo = errors_of(filters, slot, OWN, common, each, m)
        B = slopes_of(filters, slot, m)
        C = (filters[slot, 2, m], filters[slot, 3, m], filters[slot, 4, m])
        mx = filters[slot, 0, m] + B[0] * scale + B[1] * offset
        my = filters[slot, 1, m] + B[2] * scale + B[3] * offset
        e, hx, hy, _, hs, ho = sensed(
            mx - poses[0, m], my - poses[1, m], poses[2, m], constant * scale, constant * offset, z, share
        )
        if e == inf:
            distance[m] = inf
            continue
        c, u, px, py, g0, g1, t0, t1 = gains(C, B, (ss, so, oo), hx, hy, constant * hs, constant * ho, var)
        far = e * e / u
        if not folded:
            distance[m] += min(far, gate) + log(u)
            refused[m] = far > gate
            if refused[m]:
                continue
        kx, ky = px / c, py / c
        whole = e + g0 * scale + g1 * offset
        filters[slot, 0, m] += kx * whole
        filters[slot, 1, m] += ky * whole
        filters[slot, 2, m] = max(C[0] - kx * px, 0.0)
        filters[slot, 3, m] = C[1] - kx * py
        filters[slot, 4, m] = max(C[2] - ky * py, 0.0)
        if wide:
            filters[slot, SLOPES, m] = B[0] - kx * g0
            filters[slot, SLOPES + 1, m] = B[1] - kx * g1
            filters[slot, SLOPES + 2, m] = B[2] - ky * g0
            filters[slot, SLOPES + 3, m] = B[3] - ky * g1
            put_errors(
                filters, slot, OWN, common, each, m,
                (scale + t0 * e / u, offset + t1 * e / u, ss - t0 * t0 / u, so - t0 * t1 / u, oo - t1 * t1 / u),
            )  # fmt: skip


@compiled
def fold_scalar(work: Array, m: int, error: float, gx: float, gy: float, gt: float, var: float) -> float:
    """Corrects a proposal by a scalar of variance `var` and derivative (gx, gy, gt); returns its whole variance."""
    f = (
        work[3 * BLOCK + m] * gx + work[6 * BLOCK + m] * gy + work[9 * BLOCK + m] * gt,
        work[4 * BLOCK + m] * gx + work[7 * BLOCK + m] * gy + work[10 * BLOCK + m] * gt,
        work[5 * BLOCK + m] * gx + work[8 * BLOCK + m] * gy + work[11 * BLOCK + m] * gt,
    )
    v = var + f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
    less = 1.0 / (v + sqrt(v * var))
    for i in range(3):
        row = (3 + 3 * i) * BLOCK + m
        p = work[row] * f[0] + work[row + BLOCK] * f[1] + work[row + 2 * BLOCK] * f[2]
        work[i * BLOCK + m] += p * error / v
        for j in range(3):
            work[row + j * BLOCK] -= p * less * f[j]
    return v


@compiled
def fold_part(
    work: Array, start: int, count: int, filters: Array, common: Array, each: bool, parts: Parts, i: int, off: Array
) -> None:
    """Corrects `count` proposals by the i-th sighting; adds its -2 log-likelihood to `off`, up to a constant."""
    slot, constant, gate = int(parts.slots[i]), parts.constant[i], parts.gate[i]
    for m in range(count):
        at = start + m
        scale, offset, ss, so, oo = errors_of(filters, slot, OWN, common, each, at)
        B = slopes_of(filters, slot, at)
        C = (filters[slot, 2, at], filters[slot, 3, at], filters[slot, 4, at])
        dx = filters[slot, 0, at] + B[0] * scale + B[1] * offset - work[m]
        dy = filters[slot, 1, at] + B[2] * scale + B[3] * offset - work[BLOCK + m]
        heading = work[2 * BLOCK + m]
        e, hx, hy, ht, hs, ho = sensed(dx, dy, heading, constant * scale, constant * offset, parts.z[i], parts.share[i])
        if e == inf:
            off[m] = inf
            continue
        u = gains(C, B, (ss, so, oo), hx, hy, constant * hs, constant * ho, parts.var[i])[1]
        f1 = -work[3 * BLOCK + m] * hx - work[6 * BLOCK + m] * hy + work[9 * BLOCK + m] * ht
        f2 = -work[4 * BLOCK + m] * hx - work[7 * BLOCK + m] * hy + work[10 * BLOCK + m] * ht
        f3 = -work[5 * BLOCK + m] * hx - work[8 * BLOCK + m] * hy + work[11 * BLOCK + m] * ht
        v = u + f1 * f1 + f2 * f2 + f3 * f3
        far = e * e / v
        off[m] += min(far, gate) + log(v)
        parts.refused[i, at] = far > gate
        if not parts.refused[i, at]:
            fold_scalar(work, m, e, -hx, -hy, ht, u)


@compiled
def misfit(
    x: float, y: float, heading: float, turned: float, z: Array, arm: Array
) -> tuple[float, float, float, float, float]:
    """Measured minus expected of a fix of a heading off by `turned`, and the antenna's place about the robot."""
    c, s = cosine_sine(heading)
    ax, ay = c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]
    return z[0] - x - ax, z[1] - y - ay, wrap(z[2] - heading - turned), ax, ay


@compiled
def fold_fix(work: Array, start: int, count: int, fixes: Whitened, i: int, turned: Array, off: Array) -> None:
    """Corrects `count` proposals by the i-th fix, of a heading off by `turned` (M,); adds its part to `off`."""
    root, gate = fixes.root[i], fixes.gate[i]
    before = np.empty(12)
    for m in range(count):
        at = start + m
        for j in range(12):
            before[j] = work[j * BLOCK + m]
        far = volume = 0.0
        for k in range(3):
            wx, wy, wt = root[k, 0], root[k, 1], root[k, 2]
            if wx == 0.0 and wy == 0.0 and wt == 0.0:
                continue
            ex, ey, et, ax, ay = misfit(
                work[m], work[BLOCK + m], work[2 * BLOCK + m], turned[at], fixes.z[i], fixes.arm[i]
            )
            e = wx * ex + wy * ey + wt * et
            v = fold_scalar(work, m, e, wx, wy, wt - wx * ay + wy * ax, 1.0)
            far += e * e / v
            volume += log(v)
        off[m] += min(far, gate) + volume
        fixes.refused[i, at] = far > gate
        if fixes.refused[i, at]:
            for j in range(12):
                work[j * BLOCK + m] = before[j]


@compiled
def take_fix(poses: Array, fixes: Whitened, i: int, gain: Array, folded: bool, turned: Array, distance: Array) -> None:
    """Corrects the heading's offset `turned` (M,) by the i-th fix of known poses, with that `gain` (3,).

    Where it is not `folded` into the proposal, adds its -2 log-likelihood to `distance` (M,), up to a constant.
    """
    root, gate = fixes.root[i], fixes.gate[i]
    for m in range(poses.shape[1]):
        ex, ey, et, _, _ = misfit(poses[0, m], poses[1, m], poses[2, m], turned[m], fixes.z[i], fixes.arm[i])
        if not folded:
            far = 0.0
            for k in range(3):
                e = root[k, 0] * ex + root[k, 1] * ey + root[k, 2] * et
                far += e * e
            distance[m] += min(far, gate)
            fixes.refused[i, m] = far > gate
        if not fixes.refused[i, m]:
            turned[m] += gain[0] * ex + gain[1] * ey + gain[2] * et


# Those of `_loops.propose`, and what the partial sightings and fixes add.
@compiled
def propose(
    poses: Array, motion: Motion, loops: Loops, filters: Array, slots: Ints, z: Array, cov: Array, common: Array,
    each: bool, parts: Parts, fixes: Whitened, turned: Array, distance: Array, volume: Array,
) -> None:  # fmt: skip
    """As `_loops.propose`, with ranges and bearings alone after whole sightings, and fixes after these."""
    for start in range(0, poses.shape[1], BLOCK):
        part = slice(start, start + BLOCK)
        off = distance[part]
        count = len(off)
        work = np.empty(ROWS * BLOCK)
        predict(work, poses, start, count, motion)
        fold_loops(work, count, loops, start, off)
        fold_all(work, count, filters, slots, z, cov, part, off, volume)
        for k in range(len(parts.slots)):
            fold_part(work, start, count, filters, common, each, parts, k, off)
        for k in range(len(fixes.z)):
            fold_fix(work, start, count, fixes, k, turned, off)
        draw(work, poses, start, count, motion.noise)
