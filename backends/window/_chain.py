"""Eliminates the variables of a window one after another.

A pose is eliminated together with the motion that leaves it. Linearised, the next pose's offset is x' = u + noise with
u = G x + e (see `_links`), so the information about x is first transformed to that about u, where x' adds the motion's
own W. With S = H + W, H being the information about u and B that between u and the landmarks, what remains is

    x': W S^-1 H    x' and landmarks: W S^-1 B    landmarks: L - B' S^-1 B

Of a gyro, u also depends on its bias b, which is a landmark's row: u = G x + h b + e.

W S^-1 H is the information of the sum of both covariances. W - W S^-1 W is the same in exact arithmetic, but the
difference of two nearly equal matrices wherever odometry is much better known than the pose, as on a long way without
sightings.
"""

from math import cos, sin, sqrt

import numpy as np

from ...core.kernels._cholesky import unsigned
from ...core.kernels._planar import add_turned, information
from ...core.kernels._small import factored
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ..smoothing._factors import add_fixed, add_known, add_ranged, add_seen, add_walked
from ..smoothing._graph import ALONE, FIX, PRIOR, WHOLE
from ..smoothing._links import motion_offset
from ._window import (
    AT,
    BEFORE,
    BEGIN,
    BIAS,
    BOTTOM,
    FIRST,
    FIXED,
    FRESH,
    HELD,
    KNOWN,
    LAST,
    LEFT,
    MANY,
    MOTION,
    NAME,
    NOISE,
    NOW,
    OLD_FIXES,
    OWN,
    POSE,
    PRESENCE,
    REALS,
    RETIRED,
    SLOPE,
    SLOT,
    SLOTS,
    STAGES,
    Window,
    row,
)  # fmt: skip

DONE, RETURNS, INDEFINITE = range(3)
"""Outcomes: done; an eliminated landmark is sighted; not positive definite."""


@compiled
def enter(w: Window, v: int) -> None:
    """Puts landmark `v` into the next slot of the front, which must be free."""
    n, r, F = w.state[SLOTS], row(w), w.front
    w.state[SLOTS] = n + 1
    w.slots[n, NOW], w.marks[v, SLOT] = v, n
    k = 3 + 2 * n
    for i in range(k + 2):
        F[i * r + k] = F[i * r + k + 1] = 0.0
    F[k * r + r - 1] = F[(k + 1) * r + r - 1] = 0.0


@compiled
def slot_of(w: Window, v: int) -> int:
    """The row of landmark `v` in the front, where it is put if need be; -1 if it is held fixed."""
    if w.marks[v, SLOT] == FRESH:
        enter(w, v)
    return -1 if w.marks[v, SLOT] == FIXED else 3 + 2 * w.marks[v, SLOT]


@compiled
def add_part(w: Window, i: int, s: int, il: int) -> int:
    """Adds row `s` of pose `i`, not a sighting without constant errors; the landmark is at row `il`.

    It is a range with them, their prior, a fix, or the walk of a gyro's bias.
    """
    x, v, part, r = w.poses[i], w.sightings[s], w.parts[s], row(w)
    if part <= FIX:
        add_fixed(
            x[0], x[1], x[2], w.places[v, 0], w.fixed, FIX - part - w.state[OLD_FIXES], w.front, r, 0, il
        )  # fmt: skip
    elif part == PRIOR:
        add_known(w.places[v, 0], w.places[v, 1], w.seen, s, w.front, r, il)
    elif w.marks[part, SLOT] == RETIRED:
        return RETURNS
    elif w.seen[s, 4] > 0.0:
        add_walked(w.places[v, 0] - w.places[part, 0], w.seen[s, 4], w.front, r, il, slot_of(w, part))
    else:
        add_ranged(
            x[0], x[1], w.places[v, 0], w.places[v, 1], w.places[part, 0], w.places[part, 1],
            w.seen, s, w.settings, w.front, r, 0, il, slot_of(w, part),
        )  # fmt: skip
    return DONE


@compiled
def sight(w: Window, i: int) -> int:
    """Adds the sightings from pose `i`, whose rows are the front's first, and its fixes to the front."""
    x, parts = w.poses[i], w.parts
    for s in range(w.rows[i, FIRST], w.rows[i + 1, FIRST]):
        v = w.sightings[s]
        if v == HELD:
            continue
        if w.marks[v, SLOT] == RETIRED:
            return RETURNS
        il = slot_of(w, v)
        if ALONE <= parts[s] <= WHOLE:
            add_seen(x[0], x[1], x[2], w.places[v, 0], w.places[v, 1], w.seen, s, w.settings, w.front, row(w), 0, il)
        elif add_part(w, i, s, il) == RETURNS:
            return RETURNS
    return DONE


@compiled
def stage(w: Window, own: int, name: int) -> int:
    """Appends a stage; returns where its numbers begin."""
    t, o, n = w.state[STAGES], w.state[REALS], w.state[SLOTS]
    width = 3 if own == POSE else 2
    w.state[STAGES], w.state[REALS] = t + 1, o + width * (width + 2 * n + 4)
    w.stages[t, OWN], w.stages[t, MANY], w.stages[t, BEGIN], w.stages[t, NAME] = own, n, o, name
    return o


@compiled
def subtract(w: Window) -> None:
    """Subtracts A' A from the front, A being the last stage's rows: after a pose, from its landmarks' part alone."""
    t = w.state[STAGES] - 1
    m, o = 2 * w.stages[t, MANY] + 3, w.stages[t, BEGIN]
    F, R, r, pose = w.front, w.reals, row(w), w.stages[t, OWN] == POSE
    c = m + 4 if pose else m + 3
    o, first = (o + 3, 3) if pose else (o + 2, 0)
    p, q, s, end = unsigned(o), unsigned(o + c), unsigned(o + 2 * c), unsigned(m)
    for i in range(first, m):
        to = unsigned(i * r)
        a, b = R[o + i], R[o + c + i]
        if pose:
            d = R[o + 2 * c + i]
            for j in range(unsigned(i), end):
                F[to + j] -= a * R[p + j] + b * R[q + j] + d * R[s + j]
            F[i * r + r - 1] -= a * R[o + m] + b * R[o + c + m] + d * R[o + 2 * c + m]
        else:
            for j in range(unsigned(i), end):
                F[to + j] -= a * R[p + j] + b * R[q + j]
            F[i * r + r - 1] -= a * R[o + m] + b * R[o + c + m]


@compiled
def turned(w: Window, i: int, o: int, c: int) -> tuple[bool, float, float, float, float, float]:
    """Writes the information about u, W beside it, as the three rows of a stage at `o`, of `c` numbers each.

    The landmarks' right-hand side in the front becomes that beside u. Returns False if the motion has no covariance,
    the offset e, and the two entries of G that are not those of the identity.
    """
    n, F, R, r = 2 * w.state[SLOTS], w.front, w.reals, row(w)
    p, q = w.poses[i], w.poses[i + 1]
    dx, dy, turn = q[MOTION], q[MOTION + 1], q[MOTION + 2]
    if w.rows[i + 1, BIAS]:
        bias = w.places[w.rows[i + 1, BIAS] - 1, 0]
        dx, dy, turn = dx + q[SLOPE] * bias, dy + q[SLOPE + 1] * bias, turn + q[SLOPE + 2] * bias
    e0, e1, e2, co, si = motion_offset(p[0], p[1], p[2], q[0], q[1], q[2], dx, dy, turn)
    gx, gy = p[1] - q[1], q[0] - p[0]
    noise, W = np.zeros(6), np.empty(6)
    add_turned(noise, co, si, q, NOISE)
    if not information(noise, 0, W, 0):
        return False, e0, e1, e2, gx, gy
    a, b, t, d, e, f = F[0], F[1], F[2], F[r + 1], F[r + 2], F[2 * r + 2]
    f += gx * (gx * a - 2 * t) + gy * (gy * d - 2 * e) + 2 * gx * gy * b
    t, e = t - gx * a - gy * b, e - gx * b - gy * d
    o1, o2 = o + c, o + 2 * c
    R[o], R[o + 1], R[o + 2], R[o + 3], R[o + 4], R[o + 5] = a, b, t, W[0], W[1], W[2]
    R[o1], R[o1 + 1], R[o1 + 2], R[o1 + 3], R[o1 + 4], R[o1 + 5] = b, d, e, W[1], W[3], W[4]
    R[o2], R[o2 + 1], R[o2 + 2], R[o2 + 3], R[o2 + 4], R[o2 + 5] = t, e, f, W[2], W[4], W[5]
    for j in range(n):
        u0, u1 = F[3 + j], F[r + 3 + j]
        u2 = F[2 * r + 3 + j] - gx * u0 - gy * u1
        R[o + 6 + j], R[o1 + 6 + j], R[o2 + 6 + j] = u0, u1, u2
        F[(3 + j) * r + r - 1] += u0 * e0 + u1 * e1 + u2 * e2
    h0, h1 = F[r - 1], F[2 * r - 1]
    h2 = F[3 * r - 1] - gx * h0 - gy * h1
    R[o + c - 1] = h0 + a * e0 + b * e1 + t * e2
    R[o1 + c - 1] = h1 + b * e0 + d * e1 + e * e2
    R[o2 + c - 1] = h2 + t * e0 + e * e1 + f * e2
    return True, e0, e1, e2, gx, gy


@compiled
def slope(w: Window, i: int) -> tuple[float, float, float]:
    """The derivative h of the offset e between poses `i` and i + 1 by the bias of a gyro."""
    c, s, q = cos(w.poses[i, 2]), sin(w.poses[i, 2]), w.poses[i + 1]
    return c * q[SLOPE] - s * q[SLOPE + 1], s * q[SLOPE] + c * q[SLOPE + 1], q[SLOPE + 2]


@compiled
def lean(w: Window, k: int, o: int, c: int, h: tuple[float, float, float]) -> None:
    """Makes u = G x + e + h b of u = G x + e, b being the offset of the bias in slot `k`: u - h b replaces u.

    The rows of a stage at `o` are as `turned` has written them.
    """
    F, R, r, m, b = w.front, w.reals, row(w), 2 * w.state[SLOTS], 2 * k
    for j in range(m):
        by = h[0] * R[o + 6 + j] + h[1] * R[o + c + 6 + j] + h[2] * R[o + 2 * c + 6 + j]
        F[(3 + min(b, j)) * r + 3 + max(b, j)] -= 2 * by if j == b else by
    for a in range(3):
        q = o + a * c
        more = R[q] * h[0] + R[q + 1] * h[1] + R[q + 2] * h[2]
        F[(3 + b) * r + 3 + b] += h[a] * more
        F[(3 + b) * r + r - 1] -= h[a] * R[q + c - 1]
        R[q + 6 + b] -= more


@compiled
def eliminate(w: Window, i: int) -> int:
    """Eliminates pose `i` from the front in favour of pose i + 1."""
    bias = w.rows[i + 1, BIAS] - 1
    if bias >= 0:
        slot_of(w, bias)
    c = 2 * int(w.state[SLOTS]) + 7
    o = stage(w, POSE, i)
    w.rows[i, AT] = w.state[STAGES] - 1
    known, e0, e1, e2, gx, gy = turned(w, i, o, c)
    if not known:
        return INDEFINITE
    if bias >= 0:
        lean(w, w.marks[bias, SLOT], o, c, slope(w, i))
    F, R, r, o1, o2 = w.front, w.reals, row(w), o + c, o + 2 * c
    r00, r01, r11, r02, r12, r22 = factored(
        R[o] + R[o + 3], R[o + 1] + R[o + 4], R[o1 + 1] + R[o1 + 4],
        R[o + 2] + R[o + 5], R[o1 + 2] + R[o1 + 5], R[o2 + 2] + R[o2 + 5],
    )  # fmt: skip
    if not (r00 > 0.0 and r11 > 0.0 and r22 > 0.0):
        return INDEFINITE
    i0, i1, i2 = 1.0 / r00, 1.0 / r11, 1.0 / r22
    k0, k1, k2 = unsigned(o), unsigned(o1), unsigned(o2)
    for j in range(unsigned(c)):
        u0 = R[k0 + j] * i0
        u1 = (R[k1 + j] - r01 * u0) * i1
        R[k0 + j], R[k1 + j], R[k2 + j] = u0, u1, (R[k2 + j] - r02 * u0 - r12 * u1) * i2
    subtract(w)
    l0, l1, l2 = unsigned(o + 6), unsigned(o1 + 6), unsigned(o2 + 6)  # the landmarks' part
    for a in range(3):
        v0, v1, v2 = R[o + 3 + a], R[o1 + 3 + a], R[o2 + 3 + a]
        to = unsigned(a * r + 3)
        for j in range(unsigned(c - 7)):
            F[to + j] = v0 * R[l0 + j] + v1 * R[l1 + j] + v2 * R[l2 + j]
        F[a * r + r - 1] = v0 * R[o + c - 1] + v1 * R[o1 + c - 1] + v2 * R[o2 + c - 1]
        for b in range(a, 3):
            here = v0 * R[o + b] + v1 * R[o1 + b] + v2 * R[o2 + b]
            there = R[o + 3 + b] * R[o + a] + R[o1 + 3 + b] * R[o1 + a] + R[o2 + 3 + b] * R[o2 + a]
            F[a * r + b] = (here + there) / 2
    R[o], R[o + 1], R[o + 2] = r00, r01, r00 * gx + r01 * gy + r02
    R[o1], R[o1 + 1], R[o1 + 2] = 0.0, r11, r11 * gy + r12
    R[o2], R[o2 + 1], R[o2 + 2] = 0.0, 0.0, r22
    for k in range(o, o + 3 * c, c):
        for j in range(3, 6):
            R[k + j] = -R[k + j]
        R[k + c - 1] -= R[k] * (e0 - gx * e2) + R[k + 1] * (e1 - gy * e2) + R[k + 2] * e2
    if bias >= 0:
        (h0, h1, h2), at = slope(w, i), 6 + 2 * w.marks[bias, SLOT]
        for k in range(o, o + 3 * c, c):
            R[k + at] += R[k] * (h0 - gx * h2) + R[k + 1] * (h1 - gy * h2) + R[k + 2] * h2
    return DONE


@compiled
def retire(w: Window, k: int) -> int:
    """Eliminates the landmark of slot `k` from the front; that of the last slot replaces it."""
    v, n, F, R, r = w.slots[k, NOW], w.state[SLOTS], w.front, w.reals, row(w)
    o = stage(w, k, v)
    m, c, a = 2 * n + 3, 2 * n + 6, 3 + 2 * k
    for i in range(2):
        for j in range(a):
            R[o + i * c + 2 + j] = F[j * r + a + i]
        for j in range(a + 2, m):
            R[o + i * c + 2 + j] = F[(a + i) * r + j]
        R[o + i * c + 2 + a] = R[o + i * c + 2 + a + 1] = 0.0
        R[o + i * c + 2 + m] = F[(a + i) * r + r - 1]
    d = F[a * r + a]
    if not d > 0.0:
        return INDEFINITE
    r00 = sqrt(d)
    r01 = F[a * r + a + 1] / r00
    d = F[(a + 1) * r + a + 1] - r01 * r01
    if not d > 0.0:
        return INDEFINITE
    r11 = sqrt(d)
    R[o], R[o + 1], R[o + c], R[o + c + 1] = r00, r01, 0.0, r11
    for j in range(2, m + 3):
        R[o + j] /= r00
        R[o + c + j] = (R[o + c + j] - r01 * R[o + j]) / r11
    subtract(w)
    w.marks[v, SLOT], w.state[SLOTS] = RETIRED, n - 1
    b = 3 + 2 * (n - 1)
    if a == b:
        return DONE
    for i in range(2):
        for j in range(a):
            F[j * r + a + i] = F[j * r + b + i]
        for j in range(a + 2, b):
            F[(a + i) * r + j] = F[j * r + b + i]
        F[(a + i) * r + r - 1] = F[(b + i) * r + r - 1]
    F[a * r + a], F[a * r + a + 1] = F[b * r + b], F[b * r + b + 1]
    F[(a + 1) * r + a + 1] = F[(b + 1) * r + b + 1]
    w.slots[k, NOW] = w.slots[n - 1, NOW]
    w.marks[w.slots[k, NOW], SLOT] = k
    return DONE


@compiled
def begin(w: Window) -> None:
    """Sets the front to the prior, with nothing eliminated."""
    n = w.state[KNOWN]
    w.state[STAGES] = w.state[REALS] = 0
    w.state[SLOTS] = n
    for v in range(len(w.marks)):
        if w.marks[v, SLOT] != FIXED:
            w.marks[v, SLOT] = FRESH
    for k in range(n):
        w.slots[k, NOW] = w.slots[k, BEFORE]
        w.marks[w.slots[k, BEFORE], SLOT] = k
    copy(w.prior, w.front, n, row(w))


@compiled
def copy(of: Array, to: Array, n: int, r: int) -> None:
    """Copies a front with `n` landmarks and rows of `r` numbers."""
    m = 3 + 2 * n
    for i in range(m):
        for j in range(unsigned(i * r + i), unsigned(i * r + m)):
            to[j] = of[j]
        to[i * r + r - 1] = of[i * r + r - 1]


@compiled
def chain(w: Window, end: int, before: int) -> int:
    """Eliminates, from the prior on, the poses before `end`, which is then the front's, its sightings not summed yet.

    A landmark is eliminated with the last pose that sighted it, if it has left or that pose is one before `before`.
    """
    begin(w)
    for i in range(w.state[BOTTOM], end):
        ended = sight(w, i)
        for k in range(w.state[SLOTS] - 1, -1, -1):
            v = w.slots[k, NOW]
            if ended == DONE and w.marks[v, LAST] <= i and (w.marks[v, PRESENCE] == LEFT or w.marks[v, LAST] < before):
                ended = retire(w, k)
        if ended == DONE:
            ended = eliminate(w, i)
        if ended != DONE:
            return ended
    return DONE
