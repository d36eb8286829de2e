"""Tells which of the landmarks sighted in a frame are where the map has them, relative to one another.

A robot that is lost sees every landmark elsewhere, though none has moved. So the pose counts as hardly known: only what
no motion of the robot explains speaks against a landmark. Each is judged by its distance conditional on the largest set
of sightings that agree with the map, found by the search of joint compatibility.
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._expected import distance
from .._joint_compatibility import Frame, Gates, extended, search

LOOSE = 0.2
"""Standard deviation of the pose: rad, and as a share of the furthest range."""

ENOUGH = 3
"""Sightings that fix the pose and can disagree about it; of fewer the backend's own pose is asked, by a covariance
that is DOUBT times as large: a filter that is overconfident errs by three of its standard deviations."""

DOUBT = 9.0

AGREES, OFF, ELSEWHERE = 0, 1, 2
"""A sighting agrees with the map; it is off; it is off, and where another landmark is that is not sighted."""

STANDS, STOOD_ELSEWHERE, MOVED = 0, 1, 2
"""A landmark stands; it has been mapped at a wrong place; it has moved, or moves."""

FEW = 3
"""Sightings that agree with a landmark before it counts as settled."""

FORGETS = (0.7, 0.95)
"""The shares of the sum of residuals that a further sighting leaves: for larger and for smaller steps."""

TURNED = 0.1
"""rad, standard deviation of the heading's error between sightings, which turns a displacement."""

LATE = 3.0
"""Intervals between sightings that differ by a larger factor say nothing of a steady motion."""

ANY = 1e300
"""A gate without end."""


class Sightings(NamedTuple):
    """k sightings in a frame."""

    z: Array  # (k, 2) range (m), bearing (rad)
    R: Array  # (k, 2, 2)
    rows: Ints  # (k,) of their landmarks among those expected, -1: new
    settled: Ints  # (k,) how many sightings their landmarks agree with


class Records(NamedTuple):
    """The records of n landmarks, f sums of displacements among them."""

    xy: Array  # (n, 2) m, as estimated when last sighted
    agreed: Ints  # (n,) sightings that agree
    pull: Array  # (n, f, 2) the sums, in units of information
    weight: Array  # (n, f, 3) their covariances xx, xy, yy
    run: Ints  # (n,) the last sightings in a row that are off
    lately: Array  # (n, 2, 2) the last two displacements of these, m
    spreads: Array  # (n, 2, 2, 2) their covariances
    times: Array  # (n, 2) and times, s


@compiled
def judge(
    sightings: Sightings, expected: Array, cov: Array, heading: float, scale: float, gates: Gates, careful: float
) -> tuple[Ints, Array, Array, Array]:
    """Judges k sightings of landmarks `expected` (c, 2), `cov` (2c, 2c).

    Covariances are multiplied by `scale`; a squared distance is below the gates, or `careful` for a landmark that is
    not settled by FEW. Returns (k,) AGREES, OFF or ELSEWHERE, the squared distances (k,), and the displacement (k, 2)
    from the map, m in the world, with its covariance (k, 2, 2).
    """
    z, R, rows, settled = sightings
    match = gates.match
    k, m = len(z), 0
    which = np.empty(k, np.int64)
    for i in range(k):
        if rows[i] >= 0:
            which[m] = i
            m += 1
    own, at, seen, noise, furthest = (
        np.empty(m, np.int64),
        np.empty((m, 2)),
        np.empty((m, 2)),
        np.zeros((2 * m, 2 * m)),
        0.0,
    )
    for p in range(m):
        i = which[p]
        own[p], at[p], seen[p] = rows[i], expected[rows[i]], z[i]
        furthest = max(furthest, at[p, 0])
        for h in range(2):
            for g in range(2):
                noise[2 * p + h, 2 * p + g] = R[i, h, g] * scale
    frame = Frame(seen, noise, at, loosened(at, own, cov, scale, LOOSE, LOOSE * furthest))
    pair, agree = np.full(m, -1), 0
    if m >= ENOUGH:
        agree = agreeing_set(frame, Gates(ANY, match, gates.joint, gates.nodes), pair)
    if agree < ENOUGH:
        frame = Frame(seen, noise, at, loosened(at, own, cov, DOUBT * scale, 0.0, 0.0))
        agreeing_set(frame, gates, pair)
    said, apart, off, spread = np.zeros(k, np.int64), np.zeros(k), np.zeros((k, 2)), np.zeros((k, 2, 2))
    joint = frame.cov
    L, w, members = np.empty((2 * m, 2 * m)), np.empty(2 * m), np.empty(m, np.int64)
    for p in range(m):
        n = 0
        for q in range(m):
            if q != p and pair[q] >= 0:
                extended(seen, noise, at, joint, q, q, members, members, n, L, w)
                members[n] = q
                n += 1
        i, t = which[p], 2 * n
        apart[i] = extended(seen, noise, at, joint, p, p, members, members, n, L, w)
        if pair[p] < 0 or (settled[i] < FEW and apart[i] > careful):
            said[i] = OFF
        r, way = z[i, 0] - L[t, t] * w[t], heading + z[i, 1] - L[t + 1, t] * w[t] - L[t + 1, t + 1] * w[t + 1]
        off[i, 0] = z[i, 0] * cos(heading + z[i, 1]) - r * cos(way)
        off[i, 1] = z[i, 0] * sin(heading + z[i, 1]) - r * sin(way)
        a, b, c = (
            L[t, t] ** 2,
            L[t + 1, t] * L[t, t] * z[i, 0],
            (L[t + 1, t] ** 2 + L[t + 1, t + 1] ** 2) * z[i, 0] ** 2,
        )
        u, v = cos(way), sin(way)
        spread[i, 0, 0] = u * u * a - 2 * u * v * b + v * v * c
        spread[i, 1, 1] = v * v * a + 2 * u * v * b + u * u * c
        spread[i, 1, 0] = spread[i, 0, 1] = u * v * (a - c) + (u * u - v * v) * b
    for i in range(k):
        if (rows[i] < 0 or apart[i] > match) and on_another(i, sightings, said, expected, cov, match):
            said[i] = ELSEWHERE
    return said, apart, off, spread


@compiled
def loosened(at: Array, own: Ints, cov: Array, scale: float, turn: float, way: float) -> Array:
    """The joint covariance (2m, 2m) of expected sightings `at` (m, 2), rows `own` (m,) of `cov`, times `scale`.

    The pose has further standard deviations, of `turn` rad and `way` m.
    """
    m = len(at)
    J, joint = np.empty((2 * m, 3)), np.empty((2 * m, 2 * m))
    for p in range(m):
        r, c, s = at[p, 0], cos(at[p, 1]), sin(at[p, 1])
        J[2 * p, 0], J[2 * p, 1], J[2 * p, 2] = -c * way, -s * way, 0.0
        J[2 * p + 1, 0], J[2 * p + 1, 1], J[2 * p + 1, 2] = s * way / r, -c * way / r, -turn
    for p in range(m):
        for q in range(m):
            for h in range(2):
                for g in range(2):
                    value = cov[2 * own[p] + h, 2 * own[q] + g] * scale
                    for e in range(3):
                        value += J[2 * p + h, e] * J[2 * q + g, e]
                    joint[2 * p + h, 2 * q + g] = value
    return joint


@compiled
def agreeing_set(frame: Frame, gates: Gates, pair: Ints) -> int:
    """Fills `pair` (m,) with -1 for sightings that are not in the largest set that agrees; returns its size."""
    z, noise, at, cov = frame
    m = len(z)
    d2 = np.full((m, m), np.inf)  # each is of its own landmark or of none
    for p in range(m):
        a = 2 * p
        d2[p, p] = distance(
            z[p, 0] - at[p, 0], wrap(z[p, 1] - at[p, 1]), cov[a, a] + noise[a, a], cov[a + 1, a] + noise[a + 1, a],
            cov[a + 1, a + 1] + noise[a + 1, a + 1],
        )  # fmt: skip
    search(frame, np.zeros(m, np.int64), d2, gates, pair)
    agree = 0
    for p in range(m):
        agree += pair[p] >= 0
    return agree


@compiled
def on_another(i: int, sightings: Sightings, said: Ints, expected: Array, cov: Array, match: float) -> bool:
    """Tells if sighting i is where another landmark is expected that no sighting agrees with."""
    z, R, rows = sightings.z, sightings.R, sightings.rows
    for other in range(len(expected)):
        a, free = 2 * other, other != rows[i]
        for j in range(len(z)):
            free = free and not (rows[j] == other and said[j] == AGREES)
        if free and distance(
            z[i, 0] - expected[other, 0], wrap(z[i, 1] - expected[other, 1]), cov[a, a] + R[i, 0, 0],
            cov[a + 1, a] + R[i, 1, 0], cov[a + 1, a + 1] + R[i, 1, 1],
        ) < match:  # fmt: skip
            return True
    return False


@compiled
def follow(
    records: Records, slots: Ints, said: Ints, t: float, off: Array, spread: Array, match: float, alarm: float
) -> Ints:
    """Adds the k sightings of a frame to the records of their landmarks, `slots` (k,); returns (k,) what these do.

    Two tests. Sightings that are off: the last three in a row, which agree on another place or on a steady motion.
    Sightings that agree: sums of displacements that forget, against the squared distance `alarm`.
    """
    _, agreed, pull, weight, run, lately, spreads, times = records
    found = np.zeros(len(slots), np.int64)
    for i in range(len(slots)):
        s, d, C = slots[i], off[i], spread[i]
        if said[i] == AGREES:
            agreed[s] += 1
            run[s] = 0
            if shifted(s, d, C, pull, weight) > alarm:
                found[i] = MOVED
        elif said[i] == OFF:
            if run[s] >= 2:
                first, second = between(d, C, lately[s, 0], spreads[s, 0]), between(d, C, lately[s, 1], spreads[s, 1])
                if first < match and second < match:
                    found[i] = MOVED if agreed[s] >= FEW else STOOD_ELSEWHERE
                elif steady(t, d, C, times[s], lately[s], spreads[s]) < match:
                    found[i] = MOVED
            run[s] += 1
            lately[s, 0], spreads[s, 0], times[s, 0] = lately[s, 1], spreads[s, 1], times[s, 1]
            lately[s, 1], spreads[s, 1], times[s, 1] = d, C, t
    return found


@compiled
def shifted(s: int, d: Array, C: Array, pull: Array, weight: Array) -> float:
    """Adds displacement d to the sums of landmark s; the largest squared distance of a sum from zero."""
    det, largest = C[0, 0] * C[1, 1] - C[1, 0] * C[1, 0], 0.0
    a, b, c = C[1, 1] / det, -C[1, 0] / det, C[0, 0] / det
    for f in range(len(FORGETS)):
        keep, p, V = FORGETS[f], pull[s, f], weight[s, f]
        p[0], p[1] = keep * p[0] + a * d[0] + b * d[1], keep * p[1] + b * d[0] + c * d[1]
        V[0], V[1], V[2] = keep * keep * V[0] + a, keep * keep * V[1] + b, keep * keep * V[2] + c
        largest = max(largest, distance(p[0], p[1], V[0], V[1], V[2]))
    return largest


@compiled
def between(d: Array, C: Array, e: Array, D: Array) -> float:
    """Squared distance of two displacements, d being turned by an unknown error of the heading."""
    turned = TURNED * TURNED * (d[0] * d[0] + d[1] * d[1])
    return distance(d[0] - e[0], d[1] - e[1], C[0, 0] + D[0, 0] + turned, C[1, 0] + D[1, 0], C[1, 1] + D[1, 1] + turned)


@compiled
def steady(t: float, d: Array, C: Array, times: Array, lately: Array, spreads: Array) -> float:
    """Squared distance of a displacement from that to which two earlier ones lead at constant velocity."""
    a = (t - times[1]) / (times[1] - times[0])
    if a > LATE or a * LATE < 1:
        return np.inf
    x = d[0] - lately[1, 0] - a * (lately[1, 0] - lately[0, 0])
    y = d[1] - lately[1, 1] - a * (lately[1, 1] - lately[0, 1])
    S = C + (1 + a) ** 2 * spreads[1] + a * a * spreads[0]
    return distance(x, y, S[0, 0], S[1, 0], S[1, 1])
