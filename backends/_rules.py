"""The decision which landmark each sighting of a step is of, in one compiled call."""

from math import log

import numpy as np

from ..core.factors import UNKNOWN
from ..core.kernels._arrays import Arrays, Integers, Numbers, at
from ..core.kernels._planar import wrap
from ..core.kernels.compiled import compiled
from ..core.se2 import Array, Ints
from ._assignment import cheapest, nearest
from ._expected import ROUNDING, distance
from ._expected_arrays import expected_at
from ._joint_compatibility import Frame, Gates, search

NEAREST, CHEAPEST, JOINT = 0, 1, 2
"""Rules: nearest neighbour, maximum likelihood, joint compatibility."""

NEW, OPEN = -1, -2
"""In place of a landmark: none that is expected; too far from one to be of it, too near to be of another."""

FORBIDDEN = 1e12
"""Cost of a pair outside its gate: above any sum of others."""


@compiled
def decide(
    rule: int, frame: Frame, of: Ints, gates: Gates, far: float, signed: Array | None = None
) -> tuple[Ints, int]:
    """Pairs k sightings with c landmarks; returns (k,) a landmark, NEW or OPEN, and the pairs or nodes tried.

    `of` (k,) is the step of each sighting, any number. A pair's squared distance is within the gates, of which nearest
    neighbour and maximum likelihood know only `match`; a sighting is of a NEW landmark if it is `far` from all that no
    sighting of its step is of. `signed` (k, c, 2) has the squared distance of each pair's signatures and the logarithm
    of the variance of their difference; without, no code for them is compiled. Gates are then those of two degrees of
    freedom a pair, else of three.
    """
    z, noise, expected, cov = frame
    k, c, match = len(z), len(expected), gates.match
    of = without_gaps(of)
    d2, pair, widest = np.empty((k, c)), np.full(k, NEW), ROUNDING * max(match, far, gates.alone)
    spread = np.empty((k, c)) if rule == CHEAPEST else d2
    for i in range(k):
        for a in range(c):
            s00 = cov[2 * a, 2 * a] + noise[2 * i, 2 * i]
            s10 = cov[2 * a + 1, 2 * a] + noise[2 * i + 1, 2 * i]
            s11 = cov[2 * a + 1, 2 * a + 1] + noise[2 * i + 1, 2 * i + 1]
            off = z[i, 0] - expected[a, 0]
            if s00 > 0.0 and off * off > widest * s00:  # by the range alone
                d2[i, a] = np.inf
                continue
            d2[i, a] = distance(off, wrap(z[i, 1] - expected[a, 1]), s00, s10, s11)
            if signed is not None:
                d2[i, a] += signed[i, a, 0]
            if rule == CHEAPEST and d2[i, a] < match:
                spread[i, a] = log(s00 * s11 - s10 * s10)
                if signed is not None:
                    spread[i, a] += signed[i, a, 1]
    tried = k * c
    if c > 0:
        if rule == JOINT:
            tried = search(frame, of, d2, gates, pair, signed)
        elif rule == CHEAPEST:
            likeliest(d2, spread, of, match, pair)
        else:
            nearest(d2, match, of, pair)
    for i in range(k):
        if pair[i] >= 0:
            continue
        for a in range(c):
            if d2[i, a] < far and free(a, of[i], pair, of):
                pair[i] = OPEN
                break
    return pair, tried


@compiled
def without_gaps(of: Ints) -> Ints:
    """Numbers the steps from 0 in the order in which they come up: a step may have no sighting that is decided on."""
    out, steps = np.empty(len(of), np.int64), 0
    for i in range(len(of)):
        out[i] = steps
        for j in range(i):
            if of[j] == of[i]:
                out[i] = out[j]
                break
        if out[i] == steps:
            steps += 1
    return out


@compiled
def free(a: int, step: int, pair: Ints, of: Ints) -> bool:
    """Tells if no sighting of that step is of landmark `a`."""
    count = 0
    for i in range(len(pair)):
        if pair[i] == a and of[i] == step:
            count += 1
    return count == 0


@compiled
def likeliest(d2: Array, spread: Array, of: Ints, match: float, pair: Ints) -> None:
    """Maximises the likelihood of all pairs of a step: least sum of d2 + log det S (Hungarian method).

    A sighting that is left alone costs as much as the worst pair within the gate could.
    """
    k, c = d2.shape
    worst = match
    for i in range(k):
        for a in range(c):
            if d2[i, a] < match:
                worst = max(worst, match + spread[i, a])
    rows, cost, column = np.empty(k, np.int64), np.empty((k, c + k)), np.empty(k, np.int64)
    step = 0
    done = 0
    while done < k:
        n = 0
        for i in range(k):
            if of[i] == step:
                rows[n] = i
                n += 1
        for p in range(n):
            for a in range(c):
                inside = d2[rows[p], a] < match
                cost[p, a] = d2[rows[p], a] + spread[rows[p], a] if inside else FORBIDDEN
            for a in range(n):
                cost[p, c + a] = worst
        if n > 0:
            cheapest(cost[:n, : c + n], column)
        for p in range(n):
            if column[p] < c and d2[rows[p], column[p]] < match:
                pair[rows[p]] = column[p]
        done += n
        step += 1


@compiled
def decide_frame(
    rule: int,
    z: Array,
    R: Array,
    expected: Array,
    cov: Array,
    match: float,
    gates: Array,
    far: float,
    most: int,
    signed: Array | None = None,
) -> tuple[Ints, int]:
    """`decide` for the sightings of one step, whose covariances R (k, 2, 2) are independent.

    An error of the heading puts them all off alike, so that in joint compatibility a pair alone may be `far`.
    """
    k = len(z)
    noise = np.zeros((2 * k, 2 * k))
    for i in range(k):
        for h in range(2):
            for g in range(2):
                noise[2 * i + h, 2 * i + g] = R[i, h, g]
    frame = Frame(z, noise, expected, cov)
    return decide(rule, frame, np.zeros(k, np.int64), Gates(far, match, gates, most), far, signed)


class Decision(Arrays):
    """The rule for the sightings of a step, and the decisions on k of them."""

    rule: Integers  # (2,) the rule, and the most nodes of a search
    gates: Numbers  # (n,) joint gates by the number of pairs; then `match` and `far`, which are last
    first: Integers  # (1,) the id of a new landmark; the next ones are below it
    named: Integers  # (s,) ids, of which the first k
    said: Integers  # (2,) the number of new ones, and the pairs or nodes tried


decision_at = at(Decision)
"""The decision at an address."""


def decision_by(rule: int, match: float, gates: Array, far: float, most: int) -> Decision:
    """A decision to be made by these (see `decide`), on fewer sightings than there are joint gates."""
    return Decision(
        rule=np.array((rule, most)),
        gates=np.append(gates, (match, far)),
        first=np.zeros(1, np.int64),
        named=np.zeros(len(gates), np.int64),
        said=np.zeros(2, np.int64),
    )


@compiled
def conclude(expected: int, z: Array, R: Array) -> None:
    """Makes the decision that the `ExpectedArrays` at that address is for, if there is one: `decide_frame`, as ids.

    The sightings z (k, 2), R (k, 2, 2) are those for which it was asked.
    """
    a = expected_at(expected)
    if a.decision[0] == 0:
        return
    d, n = decision_at(a.decision[0]), a.count[0]
    last = len(d.gates) - 2
    cov = a.cov[: 4 * n * n].reshape((2 * n, 2 * n))
    pair, tried = decide_frame(
        d.rule[0], z, R, a.z[:n], cov, d.gates[last], d.gates[:last], d.gates[last + 1], d.rule[1]
    )
    new = 0
    for i in range(len(pair)):
        if pair[i] >= 0:
            d.named[i] = a.ids[pair[i]]
        elif pair[i] == NEW:
            d.named[i] = d.first[0] - new
            new += 1
        else:
            d.named[i] = UNKNOWN
    d.said[0], d.said[1] = new, tried
