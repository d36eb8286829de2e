"""The verdict on a dataset's backends: accuracy with its significance, consistency, cost."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..measure.repeats import COMPARED
from ..words.numerals import counted, listed, number
from ..words.styles import BASELINE
from .accuracy import claims
from .advice import Use, advice, unnamed
from .association import association_sentences
from .consistency import belief_sentences
from .cost_words import basis, compared, repeat_troubles
from .costs import CostRatio, all_pairs, compare_costs, rounds
from .ranking import ESTIMATES, PATHS, Ranking, judged_by, of_the_map, ordered, ranking
from .statistics import Comparison
from .summary import Line, representative
from .units import Units

MOST = 6  # backends whose cost a sentence names

_REFERENCE = (
    "There is no ground truth for the path; errors here are distances from a reference, {} of the same factors, which "
    "smoothers come close to by construction."
)
_SURVEYED = " The landmarks' places are known: the map's error is one, all landmarks aligned by themselves."


class Verdict(NamedTuple):
    """The verdict on the backends of one dataset."""

    basis: str  # what it rests on: how many logs, and what is known of them
    uses: Sequence[Use]
    sentences: Sequence[str]  # the most important first
    comparisons: Mapping[str, Sequence[Comparison]]  # by column, every pair, then each backend with dead reckoning
    costs: Mapping[str, Sequence[CostRatio]] = {}  # by column, every pair, where there are repeats


def verdict(lines: Sequence[Line]) -> Verdict:
    """Judges one dataset."""
    lines = ordered(lines)
    known = representative(lines)
    name, kind = known.name, known.truth_kind
    rests_on = f"{known.units}; {_known(known)}"
    failures = _not_done(lines)
    if not any(line.done for line in lines):
        return Verdict(rests_on, (), [f"{name}: no cell is done.", *failures], {})
    measures = judged_by(known)
    rankings = {purpose: found for purpose, column in measures.items() if (found := ranking(lines, column))}
    said: list[str] = []
    if kind == "reference":
        said.append(f"{name}: no verdict on accuracy of paths. {_REFERENCE.format(known.reference)}")
        said[0] += _SURVEYED * known.surveyed
    elif not measures:
        said.append(f"{name}: no verdict on accuracy. There is no known path to compare the estimates with.")
    elif not rankings and any("ate_origin_m" in line.values for line in lines):
        said.append(f"{name}: no verdict on accuracy. The true path is known at fewer than 3 steps, or in one place.")
    elif not rankings:
        said.append(f"{name}: no ranked backend gave a path.")
    over: list[Units] = []
    for found in rankings.values():
        said += claims(found, ESTIMATES[found.column], name, again=found.units in over)
        over.append(found.units)
    said += [known.units.scope] * bool(known.units.scope)
    if known.with_path is not None:
        said.append(f"The true path is known of {known.with_path} alone: errors of paths and NEES are over these.")
    comparisons = {found.column: [*found.comparisons, *found.baseline] for found in rankings.values()}
    sentences = [*said, *(belief_sentences(lines) if kind == "truth" else ()), *association_sentences(lines)]
    sentences += [*_cost(lines), *repeat_troubles(lines), *failures]
    if told := [line.backend for line in lines if line.told]:
        sentences.append(f"Not compared: {listed(told)} (given the ground truth).")
    costs = {column: all_pairs(lines, column) for column in COMPARED if max(map(rounds, lines)) > 1}
    return Verdict(rests_on, _uses(lines, rankings), sentences, comparisons, costs)


def _known(line: Line) -> str:
    if line.with_path is not None:
        return f"the landmarks' places are known, and the true path of {line.with_path}"
    if line.truth_kind == "truth":
        return "the true path is known"
    if line.truth_kind == "relations":
        return f"true motions between {_pairs(line)} are known, the true path is not"
    if line.truth_kind == "reference":
        return "the true path is not known" + ", the landmarks' places are" * line.surveyed
    return "neither path nor landmarks are known"


def _pairs(line: Line) -> str:
    """Counts the pairs of poses whose true motion is known."""
    judged, exact = (line.values.get(name) for name in ("relations", "relations_exact"))
    if judged is None or exact is None:
        return "some pairs of poses"
    between_scans = f", {judged.median - exact.median:,.0f} of them with a pose between two scans"
    return f"{judged.median:,.0f} pairs of poses" + between_scans * (exact.median < judged.median)


def _uses(lines: Sequence[Line], rankings: Mapping[str, Ranking]) -> list[Use]:
    """Recommends by purpose, none where no path is known; maps are the final ones if several have these."""
    known = representative(lines)
    if known.truth_kind in ("truth", "relations") and known.with_path is None:
        return [advice(purpose, found) for purpose, found in rankings.items()]
    uses, online = [unnamed(purpose, lines) for purpose in PATHS], rankings.get("online")
    if known.with_path is not None:
        uses = [advice(purpose, rankings[purpose]) for purpose in PATHS if purpose in rankings]
        online = rankings.get("online map")
    found = of_the_map(rankings.get("map"), online)
    return [*uses, advice("map", found)] if found else uses


def _cost(lines: Sequence[Line]) -> list[str]:
    """States CPU time for the whole log: the one cost that filters, smoothers and batch methods share."""
    found = sorted(
        (line for line in lines if "cpu_s" in line.values and line.backend != BASELINE),
        key=lambda line: line.values["cpu_s"].median,
    )
    if not found:
        return []
    first = found[0]
    times = [_seconds(first)]
    for line in found[1:]:
        pair = compare_costs(line, first, "cpu_s")
        borne = compared(pair, "") if pair is not None and pair.standing == "dearer" else ""
        times.append(_seconds(line) + f" ({borne.removesuffix(' as costly')})" * bool(borne))
    if len(times) > MOST:
        times = [times[0], f"{len(times) - 2} others up to {times[-1]}"]
    marked = " (*: while other cells ran beside it)" * (not all(line.alone for line in found))
    said = f"Median CPU time for the whole log: {listed(times)}{marked}."
    return [f"{said} {basis(found)}".rstrip()]


def _seconds(line: Line) -> str:
    return f"{line.backend}{'*' * (not line.alone)} {number(line.values['cpu_s'].median)} s"


def _not_done(lines: Sequence[Line]) -> list[str]:
    """Lists cells that are not done: failures count as the worst, skipped cells as absent."""
    failed = [
        f"{line.backend} failed on {line.failed} of {counted(len(line.rows), 'cell')} ({_ways(line)})"
        for line in lines
        if line.failed
    ]
    skipped = [line for line in lines if any(row.columns["status"] == "skipped" for row in line.rows)]
    said = [f"{'; '.join(failed)}; a failure counts as worse than any path."] if failed else []
    if skipped:
        said.append(f"Skipped, and so not compared there: {listed([line.backend for line in skipped])} (why, below).")
    return said


def _ways(line: Line) -> str:
    cells = [row.columns["status"] for row in line.rows]
    return ", ".join(f"{cells.count(way)} {way}" for way in dict.fromkeys(cells) if way not in ("done", "skipped"))
