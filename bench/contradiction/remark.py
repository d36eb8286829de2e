"""Remarks on a log: those on its columns, and on measurements or truth that contradict one another."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ...core.factors import Dataset, Log
from ...core.partial import BEARING, RANGE
from ...core.truth.errors import named
from ...datasets.remarks import remarks as of_columns
from ..words.numerals import number
from . import truth as of_truth
from .compass import turned_compass
from .constant import Constant, constant
from .explain import STUCK, Contradiction, contradiction
from .filtered import nis
from .fit import Fitted
from .odometry import blamed
from .outliers import outliers
from .parts import far_ranges, other_bearings, other_ids
from .places import elsewhere
from .ranges import beyond_reach, out_of_time, too_long
from .start import far_start
from .units import wrong_units

FIVEFOLD = 25.0
"""J per degree of freedom up to which noise alone may be the cause: it is five times what is stated there."""

HUNDREDFOLD = 1e4
"""Likewise, up to which it may be at all."""


class Remarks(NamedTuple):
    """Everything odd about a log, one sentence each, without its full stop."""

    columns: list[str]
    contradictions: list[str]  # between measurements, or with the truth; errors of sensor and wheels that stay
    outliers: list[str]  # sightings that do not fit a log which else agrees with itself
    mistaken: bool  # by more than noise: what looks like errors of the measurements is a mistake
    constant: Constant | None = None  # errors of sensor and wheels that stay, those that matter and others

    @property
    def all(self) -> list[str]:
        """Lists them."""
        return list(dict.fromkeys((*self.columns, *self.contradictions, *self.outliers)))


STAGES = {
    "checking its columns": 6.0,
    "checking if its measurements agree": 3.0,
    "looking for errors that stay": 12.0,
    "comparing it with its truth": 7.0,
}
"""Stages of `remarked`, each with its share of the time of a long log with a true path."""

_COLUMNS, _AGREE, _STAY, _TRUTH = STAGES

Began = Callable[[str], None]
"""Takes the name of a stage that begins."""


def silent(stage: str) -> None:
    """Says nothing of a stage."""
    del stage


def remarked(dataset: Dataset, *, thorough: bool = True, began: Began = silent) -> Remarks:
    """Looks at the log's columns, and at how far its measurements and truth agree.

    Errors that stay are looked for, unless `thorough`, only by a true path from which the log is as far as with some.
    `began` is told each of STAGES.
    """
    began(_COLUMNS)
    columns = of_columns(dataset)
    with np.errstate(all="ignore"):  # what is beyond all numbers agrees with nothing
        found, units = _of_measurements(dataset, began, thorough=thorough), list(wrong_units(*dataset))
        for look in (partial(out_of_time, kind=RANGE), other_ids, too_long, far_ranges):
            units = units or list(look(dataset))
        lone = [*(() if units else far_start(*dataset)), *beyond_reach(*dataset)]
        bearings = list(out_of_time(dataset, BEARING)) or list(other_bearings(dataset))
        units += [*bearings, *(() if units else turned_compass(*dataset))]
    return found._replace(
        columns=columns,
        contradictions=[*found.contradictions, *units],
        outliers=[*found.outliers, *lone],
        mistaken=found.mistaken or bool(units),
    )


def _of_measurements(dataset: Dataset, began: Began, *, thorough: bool | None) -> Remarks:
    """All but those on the columns; None: errors that stay are not looked for."""
    began(_AGREE)
    found = contradiction(named(*dataset))
    if found is None:
        return Remarks([], [], [], mistaken=False)
    said = sentence(found)
    if said and (found.named is not None or found.stuck):
        return Remarks([], [said], [], mistaken=True)
    places = elsewhere(*dataset)
    began(_STAY)
    stays = None if thorough is None else constant(*dataset, places.fit, thorough=thorough)
    if stays is not None and stays.matter and not (stays.fit.by_truth or _agrees_better(stays.log, found)):
        stays = None
    if stays is not None and stays.matter:
        rest = _of_measurements(dataset._replace(log=stays.log), silent, thorough=None)
        return rest._replace(contradictions=[stays.sentence, *rest.contradictions], mistaken=True, constant=stays)
    unfit = list(outliers(found.fits, places.ids))
    if (said or unfit) and (by_odometry := blamed(dataset, found.fits)):
        return Remarks([], [by_odometry], [], mistaken=True, constant=stays)
    if said:
        mistaken = not noisy(found) or bool(places.places)
        return Remarks([], [said, *places.places], places.twice, mistaken, stays)
    began(_TRUTH)
    odd = [*places.twice, *unfit]
    wrong_truth = list(contradicting_truth(dataset, found.fits, places.places, agrees=not unfit))
    return Remarks([], wrong_truth, odd, bool(wrong_truth), stays)


def _agrees_better(log: Log, found: Contradiction) -> bool:
    """True where the measurements of a log agree better than `found`."""
    right = contradiction(log)
    return right is not None and right.found.bulk < found.found.bulk


def remarks(dataset: Dataset, began: Began = silent) -> list[str]:
    """Lists everything odd about the log: one sentence each, without its full stop; `began` as in `remarked`."""
    return remarked(dataset, began=began).all


def noisy(found: Contradiction) -> bool:
    """Tells if noise alone may be the cause of a contradiction: it is small, or no usual mistake makes it smaller."""
    bulk = found.found.bulk
    return bulk < FIVEFOLD or all(2 * tried.found.bulk + tried.larger > bulk for tried in found.tried)


def sentence(found: Contradiction) -> str:
    """Says that a log contradicts itself, and why; nothing of one that does not."""
    j, begun = number(found.found.bulk), "the measurements contradict one another:"
    if found.stuck and found.contradicts:
        return f"J is {j} per degree of freedom, where 1 is expected, and {STUCK}"
    if found.named is not None:
        told, cause, least = found.named
        return f"{begun} J falls from {number(told)} to {number(least)} per degree of freedom if {cause.words}"
    if not found.contradicts:
        return ""
    kinds = ", ".join(f"{kind} {number(size)}" for kind, size in found.found.parts.items()) + _nis(found)
    causes = ["the sensor sits elsewhere or is late (bench noise tells)"] * ("sightings" in found.found.parts)
    causes += [f"noise is {number(np.sqrt(found.found.bulk))} times what is stated"] * (found.found.bulk < HUNDREDFOLD)
    causes += ["ids are wrong or landmarks move"] * ("sightings" in found.found.parts)
    causes += ["loop closures are false"] * ("loops" in found.found.parts)
    return (
        f"{begun} at the optimum J is {j} per degree of freedom ({kinds}), where 1 is expected: {', '.join(causes)}, "
        "or a frame, a sign, a unit or a clock is wrong; bench validate --explain tries the usual mistakes"
    )


def explained(name: str, dataset: Dataset) -> str:
    """Says how far a log agrees with itself, and with each usual mistake taken back, best first."""
    with np.errstate(all="ignore"):
        found = contradiction(named(*dataset), every=True)
        filtered = "" if found is None else _nis(found)
    if found is None and (dataset.log.partial is not None or dataset.log.fixes is not None):
        return (
            f"{name}: too few whole sightings of one landmark, and too few loops closed, to tell if the log agrees; "
            "of ranges alone, positions and headings the units are looked at, and of ranges and bearings alone what a "
            "true path and known places tell."
        )
    if found is None:
        return f"{name}: too few landmarks are sighted again, and too few loops closed, to tell if the log agrees."
    j, bulk = number(found.found.j), number(found.found.bulk)
    with_outliers = f", and {j} with its outliers" if j != bulk else ""
    said = [f"{name}: J is {bulk} per degree of freedom, where 1 is expected{with_outliers}{filtered}. It would be"]
    best_first = sorted(found.tried, key=lambda one: one.found.bulk)
    said += [f"  {number(one.found.bulk):>8}  if {one.words}" for one in best_first]
    return "\n".join([*said, *[f"  and {STUCK}"] * found.stuck, "A difference of less than a tenth is noise."])


def _nis(found: Contradiction) -> str:
    value = nis([log.without_loops() for log, _ in found.fits])
    return "" if value is None else f"; the EKF's NIS is {number(value)}"


def contradicting_truth(
    dataset: Dataset, fits: Sequence[tuple[Log, Fitted]], places: Sequence[str], *, agrees: bool
) -> Iterator[str]:
    """Yields what of the truth contradicts a log, by the fits of its stretches; `agrees`: all of its sightings fit.

    Single `places` that are wrong are known; where all are, or the path is, these tell nothing.
    """
    log, truth = dataset
    if truth is None or truth.kind != "truth":
        yield from places
        return
    log = named(log, truth).identified()
    said = [of_truth.of_path(part, fit, truth) for part, fit in fits]
    of_paths = [one.path for one in said if one.path]
    of_paths = of_paths[:1] or list(of_truth.late(log, truth, [one.delay for one in said if one.delay]))
    of_headings = list(dict.fromkeys(one.headings for one in said if one.headings))
    if of_paths:  # of a wrong path, headings and places tell nothing
        yield from of_paths
        return
    found = of_headings if len(of_headings) == 1 else []
    for _, fit in fits[:1]:
        found += of_truth.of_map(log, truth, fit)
    yield from found or places or (of_truth.of_sightings(log, truth, fits) if agrees else ())
