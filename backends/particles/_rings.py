"""Landmarks of which a range leaves a ring, or a bearing a ray: hypotheses about it in every particle, which die.

A hypothesis is a Gaussian of q = (logarithm of the distance, direction) from the place of the first sighting: a range
leaves the direction open, a bearing the distance, both over many hypotheses of equal weight. In q a ring and a ray are
straight, and so is a ring's dependence on a scale. Polar coordinates for ranges are Djugash and Singh's (ISER 2008). A
geometric series along a ray is Sola's (IROS 2005): each hypothesis's deviation is the same share of its distance.

A sighting corrects each hypothesis at its most likely place, found by Gauss and Newton, and weights it by Laplace's
integral there. A particle's likelihood is the sum over its hypotheses. One that has become unlikely dies, and those of
one place are merged by their moments, as are the hypotheses' beliefs about constant errors.

Columns of a landmark: its first place x, y; its own constant errors, as in `_parts.py`; then of each hypothesis -2 log
weight (infinite where it is dead), mean q, covariance (ll, lp, pp), and B, the change of q by scale and offset.
"""

from math import cos, exp, inf, log, pi, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._parts import OWN, SLOPES, Flags, errors_of, gains, put_errors, sensed

MOST = 16
"""Hypotheses of a landmark."""

NEAREST = 0.1  # m, of the first hypothesis along a ray
RATIO = 1.65
"""Of the distances of neighbours along a ray: the last is 180 m away."""

OWN_HERE, FIRST, EACH = 2, 7, 10
COLUMNS = FIRST + MOST * EACH

DEAD = 27.6
"""Twice the logarithm of the odds at which a hypothesis dies: a million to one."""

TOGETHER = 0.5
"""Squared distance, in both covariances, within which two hypotheses are merged."""

ITERATIONS = 10
SETTLED = 1e-4
"""Change of q at which an iteration ends."""


@compiled
def begin(
    poses: Array, rings: Array, slot: int, common: Array, each: bool, z: Array, ranges: bool, var: float,
    constant: float, prior: Array,
) -> None:  # fmt: skip
    """Starts a landmark in every particle from a range z[0], or a bearing z[1], of that variance.

    `prior` (5,) are its own constant errors where it has some; a range is of at least a few standard deviations.
    """
    for m in range(poses.shape[1]):
        rings[slot, 0, m], rings[slot, 1, m] = poses[0, m], poses[1, m]
        for i in range(5):
            rings[slot, OWN_HERE + i, m] = prior[i]
        scale, offset, _, _, _ = errors_of(rings, slot, OWN_HERE, common, each, m)
        scale, offset = constant * scale, constant * offset
        for h in range(MOST):
            own = rings[slot, FIRST + h * EACH : FIRST + (h + 1) * EACH]
            for i in range(EACH):
                own[i, m] = 0.0
            own[0, m] = 2.0 * log(MOST)
            if ranges:
                length, step = max(z[0] - offset, 1e-3), 2.0 * pi / MOST
                own[6, m], own[7, m] = -constant / (1.0 + scale), -constant / length
                own[1, m] = log(length / (1.0 + scale)) - own[6, m] * scale - own[7, m] * offset
                own[2, m] = poses[2, m] + (h + 0.5) * step
                own[3, m], own[5, m] = var / (length * length), 0.25 * step * step
            else:
                step = log(RATIO)
                own[1, m] = log(NEAREST) + h * step
                own[2, m] = poses[2, m] + z[1]
                own[3, m], own[5, m] = 0.25 * step * step, var


@compiled
def response(
    own: Array, centre: Array, pose: Array, errors: Array, z: Array, share: Array, var: float, constant: float,
    after: Array,
) -> float:  # fmt: skip
    """One hypothesis `own` (EACH,) corrected by a sighting: `after` (EACH + 5,) has it, and the errors (5,) as by it.

    Returns -2 log-likelihood, up to a constant.
    """
    scale, offset = errors[0], errors[1]
    S, C, B = (errors[2], errors[3], errors[4]), (own[3], own[4], own[5]), (own[6], own[7], own[8], own[9])
    far0, angle0 = own[1] + B[0] * scale + B[1] * offset, own[2] + B[2] * scale + B[3] * offset
    far, angle, s, o = far0, angle0, scale, offset
    e = u = c = pl = pp = g0 = g1 = t0 = t1 = 0.0
    settled = False
    for turn in range(ITERATIONS + 1):
        if turn == ITERATIONS:  # not to be found: linearised at the mean
            far, angle, s, o = far0, angle0, scale, offset
        r = exp(far)
        x, y = r * cos(angle), r * sin(angle)
        e, hx, hy, _, hs, ho = sensed(
            centre[0] + x - pose[0], centre[1] + y - pose[1], pose[2], constant * s, constant * o, z, share
        )
        if e == inf:
            return inf
        hl, hp, hs, ho = hx * x + hy * y, hy * x - hx * y, constant * hs, constant * ho
        e += hl * (far - far0) + hp * (angle - angle0) + hs * (s - scale) + ho * (o - offset)
        c, u, pl, pp, g0, g1, t0, t1 = gains(C, B, S, hl, hp, hs, ho, var)
        if settled or turn == ITERATIONS:
            break
        next_far = far0 + (pl + B[0] * t0 + B[1] * t1) * e / u
        next_angle = angle0 + (pp + B[2] * t0 + B[3] * t1) * e / u
        settled = abs(next_far - far) + abs(next_angle - angle) < SETTLED
        far, angle, s, o = next_far, next_angle, scale + t0 * e / u, offset + t1 * e / u
        if not abs(far - far0) + abs(angle - angle0) < 3.0:
            far, angle, s, o = far0, angle0, scale, offset
            settled = True
    kl, kp, whole = pl / c, pp / c, e + g0 * scale + g1 * offset
    after[1], after[2] = own[1] + kl * whole, own[2] + kp * whole
    after[3], after[4], after[5] = max(C[0] - kl * pl, 0.0), C[1] - kl * pp, max(C[2] - kp * pp, 0.0)
    after[6], after[7], after[8], after[9] = B[0] - kl * g0, B[1] - kl * g1, B[2] - kp * g0, B[3] - kp * g1
    after[10], after[11] = scale + t0 * e / u, offset + t1 * e / u
    after[12], after[13], after[14] = S[0] - t0 * t0 / u, S[1] - t0 * t1 / u, S[2] - t1 * t1 / u
    return e * e / u + log(u)


@compiled
def merge(one: Array, other: Array, scale: float, offset: float) -> bool:
    """Merges `other` into `one`, both (EACH,), if they are at one place; their weights are shares, not logarithms."""
    far = one[1] + one[6] * scale + one[7] * offset
    angle = one[2] + one[8] * scale + one[9] * offset
    dl = other[1] + other[6] * scale + other[7] * offset - far
    dp = wrap(other[2] + other[8] * scale + other[9] * offset - angle)
    ll, lp, pp = one[3] + other[3], one[4] + other[4], one[5] + other[5]
    det = ll * pp - lp * lp
    if not dl * dl * pp - 2.0 * dl * dp * lp + dp * dp * ll < TOGETHER * det:
        return False
    total = one[0] + other[0]
    a, b = one[0] / total, other[0] / total
    for i in range(3, EACH):
        one[i] = a * one[i] + b * other[i]
    one[3] += a * b * dl * dl
    one[4] += a * b * dl * dp
    one[5] += a * b * dp * dp
    one[1] = far + b * dl - one[6] * scale - one[7] * offset
    one[2] = angle + b * dp - one[8] * scale - one[9] * offset
    one[0], other[0] = total, 0.0
    return True


@compiled
def respond(
    poses: Array, rings: Array, slot: int, common: Array, each: bool, z: Array, share: Array, var: float,
    constant: float, distance: Array,
) -> None:  # fmt: skip
    """Corrects a landmark's hypotheses by a sighting; adds -2 log-likelihood of their mixture to `distance` (M,)."""
    after, loss = np.empty((MOST, EACH + 5)), np.empty(MOST)
    own, centre, pose, errors = np.empty(EACH), np.empty(2), np.empty(3), np.empty(5)
    for m in range(poses.shape[1]):
        errors[0], errors[1], errors[2], errors[3], errors[4] = errors_of(rings, slot, OWN_HERE, common, each, m)
        for i in range(3):
            pose[i] = poses[i, m]
        centre[0], centre[1] = rings[slot, 0, m], rings[slot, 1, m]
        least = inf
        for h in range(MOST):
            for i in range(EACH):
                own[i] = rings[slot, FIRST + h * EACH + i, m]
            loss[h] = own[0]
            if own[0] < inf:
                loss[h] += response(own, centre, pose, errors, z, share, var, constant, after[h])
            least = min(least, loss[h])
        if not least < inf:
            distance[m] = inf
            continue
        total = 0.0
        for h in range(MOST):
            alive = loss[h] - least < DEAD
            after[h, 0] = exp(-0.5 * (loss[h] - least)) if alive else 0.0
            total += after[h, 0]
        distance[m] += least - 2.0 * log(total)
        for i in range(5):
            errors[i] = 0.0
        for h in range(MOST):
            after[h, 0] /= total
            if after[h, 0] > 0.0:
                for i in range(5):
                    errors[i] += after[h, 0] * after[h, 10 + i]
        for h in range(MOST):
            if after[h, 0] > 0.0:
                ds, do = after[h, 10] - errors[0], after[h, 11] - errors[1]
                errors[2] += after[h, 0] * ds * ds
                errors[3] += after[h, 0] * ds * do
                errors[4] += after[h, 0] * do * do
        for h in range(MOST):
            for k in range(h):
                if after[h, 0] > 0.0 and after[k, 0] > 0.0:
                    merge(after[k], after[h], errors[0], errors[1])
        for h in range(MOST):
            share_ = after[h, 0]
            rings[slot, FIRST + h * EACH, m] = -2.0 * log(share_) if share_ > 0.0 else inf
            if share_ > 0.0:
                for i in range(1, EACH):
                    rings[slot, FIRST + h * EACH + i, m] = after[h, i]
        put_errors(rings, slot, OWN_HERE, common, each, m, (errors[0], errors[1], errors[2], errors[3], errors[4]))


@compiled
def likeliest(rings: Array, slot: int, m: int) -> int:
    """The likeliest hypothesis of particle m."""
    best = 0
    for h in range(1, MOST):
        if rings[slot, FIRST + h * EACH, m] < rings[slot, FIRST + best * EACH, m]:
            best = h
    return best


@compiled
def place(
    poses: Array, rings: Array, slot: int, common: Array, each: bool, clear: float, spread: float, filters: Array,
    into: int, sure: Flags,
) -> None:  # fmt: skip
    """Writes each particle's likeliest hypothesis as a landmark of `_parts.py` to `filters`, slot `into`.

    It is `sure` (M,) where twice the logarithm of its odds is above `clear`, and its deviation below `spread` times its
    distance from the robot and from the first sighting.
    """
    wide, doubt = filters.shape[1] > SLOPES, -2.0 * log(1.0 - exp(-0.5 * clear))
    for m in range(poses.shape[1]):
        h = likeliest(rings, slot, m)
        own = rings[slot, FIRST + h * EACH : FIRST + (h + 1) * EACH]
        scale, offset, ss, so, oo = errors_of(rings, slot, OWN_HERE, common, each, m)
        r = exp(own[1, m] + own[6, m] * scale + own[7, m] * offset)
        angle = own[2, m] + own[8, m] * scale + own[9, m] * offset
        x, y = r * cos(angle), r * sin(angle)
        ll, lp, pp = own[3, m], own[4, m], own[5, m]
        xl, xp = x * ll - y * lp, x * lp - y * pp
        yl, yp = y * ll + x * lp, y * lp + x * pp
        filters[into, 2, m], filters[into, 3, m], filters[into, 4, m] = (
            xl * x - xp * y,
            xl * y + xp * x,
            yl * y + yp * x,
        )
        mx, my = rings[slot, 0, m] + x, rings[slot, 1, m] + y
        b0, b1 = x * own[6, m] - y * own[8, m], x * own[7, m] - y * own[9, m]
        b2, b3 = y * own[6, m] + x * own[8, m], y * own[7, m] + x * own[9, m]
        if wide:
            filters[into, SLOPES, m], filters[into, SLOPES + 1, m] = b0, b1
            filters[into, SLOPES + 2, m], filters[into, SLOPES + 3, m] = b2, b3
            for i in range(5):
                filters[into, OWN + i, m] = rings[slot, OWN_HERE + i, m]
        filters[into, 0, m] = mx - b0 * scale - b1 * offset
        filters[into, 1, m] = my - b2 * scale - b3 * offset
        xx = filters[into, 2, m] + b0 * b0 * ss + 2.0 * b0 * b1 * so + b1 * b1 * oo
        yy = filters[into, 4, m] + b2 * b2 * ss + 2.0 * b2 * b3 * so + b3 * b3 * oo
        dx, dy = mx - poses[0, m], my - poses[1, m]
        sure[m] = own[0, m] < doubt and sqrt(xx + yy) < spread * min(r, sqrt(dx * dx + dy * dy))
