"""The decision which landmark each sighting of a step is of, in one compiled call."""

from math import log

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.factors import UNKNOWN
from ...frontend.se2 import Array, Ints
from .._answer import answer_at
from .._arrays import Arrays, Integers, Numbers, at
from .._expected import ROUNDING, distance
from .._models import wrap
from ._assignment import cheapest, nearest
from ._joint_compatibility import search

NEAREST, CHEAPEST, JOINT = 0, 1, 2
"""Rules: nearest neighbour, maximum likelihood, joint compatibility."""

NEW, OPEN = -1, -2
"""In place of a landmark: none that is expected; too far from one to be of it, too near to be of another."""

FORBIDDEN = 1e12
"""Cost of a pair outside its gate: above any sum of others."""


@compiled
def decide(
    rule: int,
    z: Array,
    noise: Array,
    of: Ints,
    expected: Array,
    cov: Array,
    match: float,
    gates: Array,
    far: float,
    alone: float,
    most: int,
) -> tuple[Ints, int]:
    """Pairs k sightings with c expected landmarks; returns (k,) a landmark, NEW or OPEN, and the pairs or nodes tried.

    z (k, 2) are range and bearing with joint covariance `noise` (2k, 2k), `of` (k,) the step of each, any number;
    `expected` (c, 2) and `cov` (2c, 2c) as `Expected` has them. A pair's squared distance is below `match`, in joint
    compatibility `alone` before it is known which others there are; a sighting is of a NEW landmark if it is `far` from
    all that no sighting of its step is of.
    """
    k, c = len(z), len(expected)
    of = without_gaps(of)
    d2, pair, widest = np.empty((k, c)), np.full(k, NEW), ROUNDING * max(match, far, alone)
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
            if rule == CHEAPEST and d2[i, a] < match:
                spread[i, a] = log(s00 * s11 - s10 * s10)
    tried = k * c
    if c > 0:
        if rule == JOINT:
            tried = search(z, noise, of, expected, cov, d2, alone, match, gates, most, pair)
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
    return decide(rule, z, noise, np.zeros(k, np.int64), expected, cov, match, gates, far, far, most)


@compiled
def name_frame(
    rule: int,
    z: Array,
    R: Array,
    ids: Ints,
    expected: Array,
    cov: Array,
    match: float,
    gates: Array,
    far: float,
    most: int,
    first: int,
    named: Ints,
) -> tuple[int, int]:
    """`decide_frame` as ids, `named` (k,): those `ids` (c,) of the landmarks; `first`, `first - 1`, ... of new ones.

    Returns the number of new ones, and the pairs or nodes tried.
    """
    pair, tried = decide_frame(rule, z, R, expected, cov, match, gates, far, most)
    new = 0
    for i in range(len(pair)):
        if pair[i] >= 0:
            named[i] = ids[pair[i]]
        elif pair[i] == NEW:
            named[i] = first - new
            new += 1
        else:
            named[i] = UNKNOWN
    return new, tried


class Rule(Arrays):
    """How to decide."""

    numbers: Integers  # (2,) the rule, and the most nodes of a search
    gates: Numbers  # (n,) joint gates by the number of pairs; then `match` and `far`, which are last


rule_at = at(Rule)
"""The rule at an address."""


def rule_of(rule: int, match: float, gates: Array, far: float, most: int) -> Rule:
    """The arrays of these; see `decide`."""
    return Rule(numbers=np.array((rule, most)), gates=np.append(gates, (match, far)))


@compiled
def name_by(rule: int, found: int, z: Array, R: Array, first: int, named: Ints) -> tuple[int, int]:
    """`name_frame` by the `Rule` and the `Answer` at these addresses."""
    r, g = rule_at(rule), answer_at(found)
    n, last = g.count[0], len(r.gates) - 2
    cov = g.cov[: 4 * n * n].reshape((2 * n, 2 * n))
    return name_frame(
        r.numbers[0], z, R, g.ids[:n], g.z[:n], cov, r.gates[last], r.gates[:last], r.gates[last + 1], r.numbers[1],
        first, named,
    )  # fmt: skip
