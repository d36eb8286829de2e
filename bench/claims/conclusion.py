"""Concludes a study: whether it reproduces what was published, from the answers to its claims.

A study reproduces its finding where all its claims hold. That is an intersection-union test (Berger, Technometrics
24(4), 1982): a finding that is false in some part is called reproduced no more often than that part's claim holds
wrongly, so the number of claims needs no correction. Each was stated before any cell ran. For a reader of single claims
Holm's correction is beside: over the tests of all of them, of `each` that of the worst value.
"""

from collections.abc import Mapping, Sequence
from math import isinf, isnan, nan
from typing import Any, Literal, NamedTuple

from ..verdict.statistics import holm
from ..words.numerals import chance, counted
from .answer import Answer, Part
from .finding import FIGURES, Verdict

SAYS = {
    "yes": ("Reproduced", "The answer is yes"),
    "no": ("Not reproduced", "The answer is no"),
    "open": ("Not decided", "There is no answer"),
}
"""what a conclusion begins with: of a published finding, and of a question of one's own"""


class Conclusion(NamedTuple):
    """The answers of a study, and their conclusion."""

    answers: tuple[Answer, ...]
    reproduced: Literal["yes", "no", "open"]
    sentence: str

    @property
    def adjusted(self) -> tuple[float, ...]:
        """The answers' p after Holm's correction over all of them that have a signed-rank test; NaN for the others."""
        p = [answer.figures.get("p") for answer in self.answers]
        return tuple(holm([nan if one is None else one for one in p]).tolist())

    @property
    def tests(self) -> str:
        """Says what Holm's correction leaves of the tests of claims that hold; "" with fewer than two."""
        found = [p for p, answer in zip(self.adjusted, self.answers, strict=True) if not isnan(p) and _held(answer)]
        if len(found) < 2:
            return ""
        every = sum(not isnan(p) for p in self.adjusted)
        most = chance(max(found))
        return f"Of the {len(found)} claims that hold by a test, the largest is {most} (Holm, {every} tests)."


def _held(answer: Answer) -> bool:
    return answer.verdict == "holds"


def conclude(answers: Sequence[Answer], finding: str) -> Conclusion:
    """Draws the conclusion; `finding` is what was published, "" for a question of one's own."""
    if not answers:
        return Conclusion((), "open", "Nothing is claimed: the numbers are the answer.")
    by: dict[Verdict, list[Answer]] = {"fails": [], "open": [], "holds": []}
    for found in answers:
        by[found.verdict].append(found)
    n, waiting = len(answers), sum(found.waiting for found in answers)
    if by["fails"]:
        reproduced, why = "no", _some(by["fails"], n, "fails", "fail")
    elif by["open"]:
        reproduced, why = "open", _some(by["open"], n, "is open", "are open")
    else:
        reproduced, why = "yes", "the claim holds" if n == 1 else f"all {n} claims hold"
    yet = " yet" if reproduced == "open" and waiting else ""
    return Conclusion(tuple(answers), reproduced, f"{SAYS[reproduced][not finding]}{yet}: {why}.")


def _some(found: Sequence[Answer], n: int, one: str, several: str) -> str:
    named = "; ".join(answer.claim.says.rstrip(".") for answer in found)
    if n == 1:
        return f"the claim {one}: {named}"
    return f"{len(found)} of {counted(n, 'claim')} {one if len(found) == 1 else several}: {named}"


def document(conclusion: Conclusion) -> dict[str, Any]:
    """The conclusion as JSON takes it: infinity is the text Infinity or -Infinity, what is missing null."""
    return {
        "reproduced": conclusion.reproduced,
        "sentence": conclusion.sentence,
        "claims": [_claim(*one) for one in zip(conclusion.answers, conclusion.adjusted, strict=True)],
    }


def _claim(answer: Answer, adjusted: float) -> dict[str, Any]:
    claim = answer.claim
    return {
        "says": claim.says,
        "verdict": answer.verdict,
        "sentence": answer.sentence,
        "kind": claim.kind,
        "measure": claim.measure,
        "first": dict(claim.first),
        "second": dict(claim.second),
        "where": dict(claim.where),
        "along": claim.along or None,
        "each": claim.each or None,
        "bounds": [_plain(claim.low), _plain(claim.high)],
        "waiting": answer.waiting,
        **_figures(answer.figures),
        "p_holm": _plain(adjusted),
        "parts": [_part(part) for part in answer.parts],
    }


def _part(part: Part) -> dict[str, Any]:
    found = part.found._asdict()
    return {"value": part.value, "verdict": part.found.verdict, **_figures({name: found[name] for name in FIGURES})}


def _figures(figures: Mapping[str, Any]) -> dict[str, Any]:
    return {name: [_plain(v) for v in value] if name == "medians" else _plain(value) for name, value in figures.items()}


def _plain(value: float | None) -> float | str | None:
    if value is None or isnan(value):
        return None
    return ("-" * (value < 0) + "Infinity") if isinf(value) else value
