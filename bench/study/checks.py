"""Checks a study's claims and figures against its cells: parameters, values and columns that they name."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ...core.errors import InputError, nearest
from ...core.toml.table import TomlTable, is_number, shown
from ..words.columns import CELLS, METRICS
from .blocks import Combination
from .study import Claim, Figure

COLUMNS = (*CELLS, *METRICS)
MEASURES = tuple(column.name for column in COLUMNS if column.kind.is_measured)  # the columns that are numbers
MOST = 8  # values that a sentence names

Cells = Sequence[Combination]
Selection = Mapping[str, Any]


def check_claim(claim: Claim, words: TomlTable, cells: Cells) -> None:
    """Raises InputError where a claim names what no cell has, does not vary, or leaves the cells ambiguous."""
    _check_measure(words, "measure", claim.measure, cells)
    _check_selection(words, "where", claim.where, cells)
    keys = {"value": ("of",), "grows": ("of",), "alike": ("alike", "to")}.get(claim.kind, ("less", "than"))
    selections = (claim.first, claim.second)[: len(keys)]
    sides = [_side(words, key, own, claim.where, cells) for key, own in zip(keys, selections, strict=True)]
    if len(keys) == 2 and claim.first == claim.second:
        raise words.fault(keys[1], f"other cells than {keys[0]}'s")
    if claim.along:
        _check_varies(words, claim.kind, claim.along, sides, numbers=True)
        for value in _values(claim.along, [one for side in sides for one in side]):
            if value <= 0:
                raise words.fault(claim.kind, f"a parameter whose values are above 0; {claim.along} has {shown(value)}")
    if claim.each:
        if claim.each == claim.along:
            raise words.fault("each", f"another parameter than that of {claim.kind}")
        _check_varies(words, "each", claim.each, sides, numbers=False)
    for value in _common(claim.each, sides) if claim.each else [None]:
        there = [_known(side, {claim.each: value}) if claim.each else side for side in sides]
        for key, side in zip(keys, there, strict=True):
            _check_one(words, key if words.has(key) else "says", claim.along, side)
        if len(keys) == 2 and _logs(there[0], there).isdisjoint(_logs(there[1], there)):
            raise words.refused(keys[1], f"has no log in common with {keys[0]}, expected the same seeds and datasets.")


def check_figure(figure: Figure, words: TomlTable, cells: Cells) -> None:
    """Raises InputError where the figure names what no cell has, or has nothing to draw."""
    _check_measure(words, "y", figure.y, cells)
    _check_selection(words, "where", figure.where, cells)
    there = [one for one in cells if all(_has(one, name, value) for name, value in figure.where.items())]
    if not there:
        raise _none(words, "where", figure.where)
    _check_parameter(words, "by", figure.by, cells)
    if figure.x == figure.by:
        raise words.refused("by", f"found {figure.by!r}, which is x, expected another parameter.")
    _check_varies(words, "x", figure.x, [there], numbers="x" in figure.log)
    for value in _values(figure.x, there) if "x" in figure.log else []:
        if value <= 0:
            raise words.fault("log", f"no x in it: {figure.x} is {shown(value)} in some cells")
    for whose, values in figure.printed.items():
        _check_printed(words.table("printed").table(whose), figure.x, values, _values(figure.x, there))


def _check_printed(words: TomlTable, x: str, values: Iterable[Any], known: Sequence[Any]) -> None:
    """Raises InputError unless published values are of values of x, which are words."""
    for value in values:
        if not all(isinstance(one, str) for one in known):
            raise words.refused(value, f"{x} has values that are no words, expected printed values beside words alone.")
        if value not in known:
            raise words.refused(value, f"no cell of the figure has {x} = {shown(value)}, expected one that is drawn.")


def _side(words: TomlTable, key: str, selection: Selection, where: Selection, cells: Cells) -> Cells:
    """Selects the cells of one side: with its own values, and those of `where` that its cells have."""
    inside = words.table(key)
    if "measure" in selection:
        _check_measure(inside, "measure", str(selection["measure"]), cells)
    own = {name: value for name, value in selection.items() if name != "measure"}
    _check_selection(inside, "", own, cells)
    for name in own:
        if name in where:
            raise inside.refused(name, "is in where as well, expected in one of them.")
    there = [one for one in cells if all(_has(one, name, value) for name, value in own.items())]
    if not there:
        raise _none(words, key, own)
    there = _known(there, where)
    if not there:
        raise _none(words, key, {**own, **where})
    return there


def _none(words: TomlTable, key: str, selection: Selection) -> InputError:
    said = " and ".join(f"{name} = {shown(value)}" for name, value in selection.items())
    return words.refused(key, f"no cell has {said} together, expected a selection that some have.")


def _known(cells: Cells, selection: Selection) -> Cells:
    """Selects cells with all the values, except of parameters that none of them has."""
    for name, value in selection.items():
        if _values(name, cells):
            cells = [one for one in cells if _has(one, name, value)]
    return cells


def _has(one: Combination, name: str, value: Any) -> bool:
    return value in one.seeds if name == "seed" else one.parameters[name] == value


def _values(name: str, cells: Iterable[Combination]) -> list[Any]:
    if name == "seed":
        return sorted({seed for seeds in {tuple(one.seeds) for one in cells} for seed in seeds})
    return [v for v in dict.fromkeys(one.parameters[name] for one in cells) if v is not None]


def _common(name: str, sides: Sequence[Cells]) -> list[Any]:
    """Lists the values that all sides have whose cells have the parameter at all."""
    first, *others = [values for side in sides if (values := _values(name, side))] or [[]]
    return [value for value in first if all(value in values for values in others)]


def _logs(side: Cells, sides: Sequence[Cells]) -> set[tuple[str, int]]:
    """Identifies the side's logs: by seed where it makes the log, by dataset where there are several."""
    several = any(len(_values("dataset", one)) > 1 for one in sides)
    return {
        (one.parameters["dataset"] if several else "", seed if one.dataset.numbered else 0)
        for one in side
        for seed in one.seeds
    }


def _check_measure(words: TomlTable, key: str, name: str, cells: Cells) -> None:
    if name not in MEASURES and any(column.name == name for column in COLUMNS):
        raise words.refused(key, f"column {name} is not a number; expected one of cells.csv or metrics.csv that is.")
    if name in cells[0].parameters:
        raise words.refused(key, f"{name} is swept, so it is a parameter here, expected a column that is measured.")
    if name not in MEASURES:
        raise words.refused(key, f"there is no column {name!r}; {nearest(name, MEASURES)}")


def _check_parameter(words: TomlTable, key: str, name: str, cells: Cells) -> None:
    if name not in cells[0].parameters:
        raise words.refused(key, f"no cell has a parameter {name!r}; {nearest(name, cells[0].parameters)}")


def _check_selection(words: TomlTable, key: str, selection: Selection, cells: Cells) -> None:
    """Raises InputError for a parameter or value that no cell has; `key` is the selection's, "" for `words` itself."""
    inside = words.table(key) if key else words
    for name, value in selection.items():
        _check_parameter(inside, name, name, cells)
        if not any(_has(one, name, value) for one in cells):
            found = _values(name, cells)
            known = ", ".join(shown(one) for one in found[:MOST]) + ", ..." * (len(found) > MOST)
            raise inside.refused(name, f"no cell has {shown(value)}, expected one of {known}.")


def _check_varies(words: TomlTable, key: str, name: str, sides: Sequence[Cells], *, numbers: bool) -> None:
    """Raises InputError unless the parameter has two values or more common to all sides that have it."""
    _check_parameter(words, key, name, sides[0])
    if name == "seed":
        raise words.fault(key, "a parameter that is not the seed: intervals are over seeds")
    found = _common(name, sides)
    if len(found) < 2:
        said = f"is {shown(found[0])} in all of its cells" if found else "has no two values there"
        raise words.fault(key, f"a parameter that is swept; {name} {said}")
    for value in found:
        if numbers and not is_number(value):
            raise words.fault(key, f"a parameter whose values are numbers; {name} has {shown(value)}")


def _check_one(words: TomlTable, key: str, along: str, side: Cells) -> None:
    """Raises InputError unless only the seed and `along` vary, or the dataset where each is a single log."""
    for name in side[0].parameters:
        found = dict.fromkeys(one.parameters[name] for one in side)
        single = name == "dataset" and not any(one.dataset.numbered and len(one.seeds) > 1 for one in side)
        if len(found) > 1 and name != along and not single:
            known = ", ".join(shown(one) for one in list(found)[:MOST]) + ", ..." * (len(found) > MOST)
            raise words.refused(key, f"has cells with {name} = {known}, expected one value, by its own, where or each.")
