"""Finds the usual mistake that makes a log contradict itself."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Log
from .fit import FAR, Agreement, Fitted, agreement, fitted
from .mistakes import MISTAKES, Mistake, on_one_circle, sentence
from .stretch import stretches, tells

AGREES = 1.15
"""J per degree of freedom up to which no mistake is looked for. Made-up logs have 0.85 to 1.1, recorded ones less."""

EXPLAINED = 1.5
"""J per degree of freedom up to which noise may explain it, as it is seldom stated better than to a fifth."""

CONTRADICTS = 2.0
"""J per degree of freedom from which on a log contradicts itself: its noise is 1.4 times what is stated, or more."""

FALLEN, FITTED, THREEFOLD = 0.05, 0.005, 9.0
"""Share of J that may be left, the second with a number that is fitted, which takes some of any J; and J then, of a log
whose noise is three times what is stated. Where turns were wrapped more is left."""

AHEAD, SURE = 1.1, 50.0
"""J of the log as it is and with the next best mistake taken back, over that of the best, at least; and by how much all
of J is more: a number that is fitted lowers it by 1, the best of some hundred by 10."""

REFINED = 8
"""Numbers that are tried between two of those listed: the best is then known to 2 % of their distance."""

OUTLYING = 0.2
"""Share of the sightings that may be far out still, of a mistake that explains the others."""

STUCK = "every motion is an arc of one circle, as where one wheel's counts stand still"


class Tried(NamedTuple):
    """A mistake that was taken back."""

    words: str
    found: Agreement  # then
    larger: float  # -2 log of what noise that is larger then, for its measurements, costs, per degree of freedom
    mistake: Mistake
    fits: list[Fitted]  # of the stretches then


class Contradiction(NamedTuple):
    """The agreement of a log with itself, and the reasons against it."""

    found: Agreement
    tried: list[Tried]  # none of a log that agrees
    stuck: bool  # one wheel's counts stand still, which nothing takes back
    fits: list[tuple[Log, Fitted]]  # the stretches that could be fitted

    @property
    def contradicts(self) -> bool:
        """True where neither noise as stated nor outliers explain the log, of which there is an optimum."""
        return CONTRADICTS < self.found.bulk < np.inf

    @property
    def named(self) -> tuple[float, Tried, float] | None:
        """J of the log, the mistake if a single one explains it, and J then: of all, or else without outliers."""
        if len(self.tried) < 2 or self.stuck:
            return None
        for j in (_all, _bulk):
            best, second = sorted(self.tried, key=lambda one: j(one.found) + one.larger)[:2]
            told, least, next_best = j(self.found), j(best.found), j(second.found) + second.larger
            explained = least < max(EXPLAINED, _left(told, best.mistake, outliers=j is _all))
            ahead = min(told, next_best) - best.larger
            explained = explained and (j is _all or _far(best.fits) < OUTLYING)
            if explained and least * AHEAD < ahead < np.inf and (ahead - least) * self.found.dof > SURE:
                return told, best, least
        return None


def _left(told: float, mistake: Mistake, *, outliers: bool) -> float:
    """The J that a mistake may leave of a log's, beyond what noise explains."""
    if mistake.wrapped and not mistake.between and not outliers:
        return FALLEN * told
    share = FITTED if mistake.between and not mistake.wrapped else FALLEN
    return min(share * told, THREEFOLD)


def _far(fits: Sequence[Fitted]) -> float:
    """The share of sightings that are far out."""
    squares = np.concatenate([fit.squares for fit in fits])
    return float(np.mean(squares > FAR)) if len(squares) else 0.0


def _all(found: Agreement) -> float:
    return found.j


def _bulk(found: Agreement) -> float:
    return found.bulk


def contradiction(log: Log, *, every: bool = False) -> Contradiction | None:
    """Looks into a log; None for one that has too few measurements. `every`: the mistakes are tried in any case."""
    parts = list(stretches(log.identified()))
    if not parts:
        return None
    fits = list(map(fitted, parts))
    found, done = agreement(fits), [(part, fit) for part, fit in zip(parts, fits, strict=True) if fit is not None]
    if found.j < AGREES and not every:
        return Contradiction(found, [], False, done)
    told = np.array([agreement([fit]).j for fit in fits])
    most_first = [parts[k] for k in np.argsort(-told, kind="stable")]  # numbers are found on the first
    undone = [_tried(mistake, most_first) for mistake in MISTAKES]
    stuck = all(map(on_one_circle, parts))
    result = Contradiction(found, [one for one in undone if one is not None], stuck, done)
    return result if result.named is None else _from_there(result, most_first, result.named[1])


def _from_there(told: Contradiction, parts: Sequence[Log], cause: Tried) -> Contradiction:
    """Fits the log as it is from where it was fitted without the mistake: its own optimum may be there as well."""
    found = [fitted(part, start) for part, start in zip(parts, cause.fits, strict=True)]
    again, done = agreement(found), [(part, fit) for part, fit in zip(parts, found, strict=True) if fit is not None]
    return told if again.j > told.found.j else told._replace(found=again, fits=done)


def _tried(mistake: Mistake, parts: Sequence[Log]) -> Tried | None:
    """Takes a mistake back, with the number that is best for the first stretch; None where it is not there."""

    def undone(number: float, some: Sequence[Log] = parts) -> tuple[Agreement, float, list[Fitted | None]]:
        changed = [log for part in some if (log := mistake.undone(part, number)) is not None]
        fits = list(map(fitted, changed)) if any(map(tells, changed)) else []
        found = agreement(fits)
        larger = sum(_size(log) for log in changed) - sum(_size(log) for log in some)
        larger += 2 * sum(mistake.squeeze(log, number) for log in some)
        return found, max(larger, 0.0) / max(found.dof, 1), fits

    def score(number: float) -> float:
        found, larger, _ = undone(number, parts[:1])
        return found.j + larger

    number = min(mistake.numbers, key=score)
    if mistake.between:
        number = _refined(score, mistake.numbers, number)
    found, larger, fits = undone(number)
    if not np.isfinite(found.j) or len(fits) < len(parts):
        return None
    return Tried(sentence(mistake, number), found, larger, mistake, [fit for fit in fits if fit is not None])


def _size(log: Log) -> float:
    """The logarithms of the determinants of all covariances."""
    return float(np.linalg.slogdet(log.delta_cov[1:])[1].sum() + np.linalg.slogdet(log.z_cov)[1].sum())


def _refined(j: Callable[[float], float], numbers: Sequence[float], best: float) -> float:
    """Looks between the neighbours of the best number by golden section."""
    at, share = numbers.index(best), (3 - 5**0.5) / 2
    low = numbers[at - 1] if at else best - (numbers[1] - best)
    high = numbers[at + 1] if at + 1 < len(numbers) else best + (best - numbers[-2])
    x, least = best, j(best)
    for _ in range(REFINED):
        new = x + share * (high - x) if high - x > x - low else x - share * (x - low)
        found = j(new)
        if found < least:
            low, high, x, least = (x, high, new, found) if new > x else (low, x, new, found)
        else:
            low, high = (low, new) if new > x else (new, high)
    return x
