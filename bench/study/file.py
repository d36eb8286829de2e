"""Study files: TOML, read into a `Study`; what is wrong with one is said with its line.

    title      the headline (the file's name)
    question   what is asked
    source     who asked or answered it before
    finding    what was found then
    note       what a reader of the answer needs to know
    seeds      of every [[cells]] that has none of its own (1)
    first_seed likewise, the seed to count from where seeds is a number (0)
    timed      true: each cell alone on its machine
               (true where a figure or a claim is about a time)
    keep       true: paths and other arrays are stored, too (false)
    oracle     true: backends that ask for ground truth are given it (false)
    timeout_s, memory_mb   limits of a cell (600, 4000)

    [[cells]]  as many as needed; the study has the cells of all, none twice
    dataset    a name, name[option=value,...] or the path of a log; or a list
    backend    a name, name[option=value,...] or my_package.my_module:build;
               or a list
    grid       { "dataset.x" = [1, 2], "backend.y" = [3, 4] }
               every value with every other
    zip        such a table of lists of equal lengths
               first with first, second with second
    list       [{ "dataset.x" = 1, "backend.y" = 3 }, ...]
               these and no others
    seeds      how many, or a list; where neither log nor backend draws
               random numbers one is enough, and only one is run
    first_seed the seed to count from, where seeds is a number
    timed      of these cells

               Datasets x backends x grid x zip x list x seeds are cells, and
               dataset, backend (as written), seed and x, y are their
               parameters: "dataset.x" and "backend.x" if both are swept.
               Cells of another [[cells]] have their own value of x, if any;
               of an option that is off that is "none".

    [[figure]] medians of y over x with their intervals
    x          a parameter
    y          a column of cells.csv or metrics.csv
    by         a parameter, one line per value
               (backend, or dataset where x is the backend)
    where      { parameter = value, ... }: the cells that are drawn (all)
    log        "x", "y" or "xy": which axes are logarithmic
    title, caption
    printed    { "whose" = { value = number, ... } }: published values of y by
               values of x, where these are words, to be drawn beside

    [[claim]]  a sentence, and what makes it true
    says       the sentence
    measure    a column; any selection may have another `measure`
    where      { parameter = value, ... }: of all its cells
    each       a parameter: the claim has to hold for every value

    and one of these; {} is such a selection as `where`, bounds are above,
    below or within = [low, high]:
    of = {}, bounds                      the median; of an error of relations
                                         on one log, its mean over them
    less = {}, than = {}, factor (1)     on the same logs: smaller, and by
                                         at least that factor
    alike = {}, to = {}, by              on the same logs: equal within a
                                         share of `by`, 0.1 being 10 %
    of = {}, grows = parameter, bounds   the exponent with which it grows
    less = {}, than = {}, crosses = parameter, bounds
                                         the value from which on the one is
                                         smaller

Any value may be { quick = ..., full = ... }, one for each size of the study.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any, Literal

from ...core.toml.lines import Place
from ...core.toml.packaged import read_named
from ...core.toml.table import LARGEST, TomlTable, called, shown, too_deep
from ..words.columns import about
from .blocks import combinations
from .checks import check_claim, check_figure
from .study import Claim, Figure, Study

FORMAT = (__doc__ or "").partition("\n\n")[2]  # the format, for `bench ablate --help`
PACKAGED = Path(__file__).parent / "studies"  # the packaged studies, each NAME.toml

KEYS = (
    "title", "question", "source", "finding", "note", "seeds", "first_seed", "timed", "keep", "oracle", "timeout_s",
    "memory_mb", "cells", "figure", "claim",
)  # fmt: skip

BOUNDS = ("above", "below", "within")
CLAIMS: Mapping[str, tuple[str, ...]] = {
    "crosses": ("crosses", "less", "than", *BOUNDS),
    "grows": ("grows", "of", *BOUNDS),
    "less": ("less", "than", "factor"),
    "alike": ("alike", "to", "by"),
    "value": ("of", *BOUNDS),
}
"""the kinds of claims, each recognised by the first of its keys where it is none of those before"""

COMMON = ("says", "measure", "where", "each")


def packaged() -> list[str]:
    """Lists the names of the packaged studies."""
    return sorted(path.stem for path in PACKAGED.glob("*.toml"))


def read(which: str, *, full: bool) -> Study:
    """Reads the packaged study of that name, or the file at that path, in its quick or full size."""
    path, text = read_named(which, PACKAGED, packaged(), "study")
    return made(str(path), text, full=full)


def made(file: str, text: str, *, full: bool) -> Study:
    """Parses a study; `file` is its name in errors, and without its folder and ending for readers.

    InputError names the file, the line and the key of the first thing that is wrong, what was found and what expected.
    """
    words = _words(file, text, full=full)
    study = _without_cells(words, text, full=full)
    measures = [claim.measure for claim in study.claims] + [figure.y for figure in study.figures]
    measures += [side.get("measure", "") for claim in study.claims for side in (claim.first, claim.second)]
    found = combinations(words, timed=words.switch("timed", any(about(name).kind.is_time for name in measures)))
    for claim, entry in zip(study.claims, words.tables("claim", ""), strict=True):
        check_claim(claim, entry, found)
    for figure, entry in zip(study.figures, words.tables("figure", ""), strict=True):
        check_figure(figure, entry, found)
    cells = tuple(cell for one in found for cell in one.cells())
    return replace(study, cells=cells)


def reread(file: str, text: str, *, full: bool) -> Study:
    """Parses a text that was read before, without its cells: nothing is looked up that may no longer exist."""
    return _without_cells(_words(file, text, full=full), text, full=full)


def _words(file: str, text: str, *, full: bool) -> TomlTable:
    return sized(TomlTable.parse(file, text), "full" if full else "quick").only(KEYS)


def _without_cells(words: TomlTable, text: str, *, full: bool) -> Study:
    name = Path(words.file).name.removesuffix(".toml")
    return Study(
        name=name,
        title=words.text("title", name),
        question=words.text("question", ""),
        source=words.text("source", ""),
        finding=words.text("finding", ""),
        note=words.text("note", ""),
        size="full" if full else "quick",
        cells=(),
        figures=tuple(_figure(entry) for entry in words.tables("figure", "[[figure]] with x and y")),
        claims=tuple(_claim(entry) for entry in words.tables("claim", "[[claim]] with what it says and a measure")),
        keep=words.switch("keep", False),
        oracle=words.switch("oracle", False),
        timeout_s=words.number("timeout_s", 600.0, above=0),
        memory_mb=words.whole("memory_mb", 4000, 1, 10**9),
        text=text,
    )


def _figure(words: TomlTable) -> Figure:
    words.only(("x", "y", "by", "where", "log", "title", "caption", "printed"))
    x = words.text("x")
    return Figure(
        x,
        words.text("y"),
        words.text("by", "dataset" if x == "backend" else "backend"),
        _selection(words, "where"),
        words.choice("log", "", ("", "x", "y", "xy")),  # pyright: ignore[reportArgumentType] - one of these
        words.text("title", ""),
        words.text("caption", ""),
        _printed(words.table("printed")),
    )


def _printed(words: TomlTable) -> dict[str, dict[Any, float]]:
    """Reads published values, by whose they are and the value of x."""
    tables = {whose: words.table(whose) for whose in words.entries}
    return {whose: {value: table.number(value) for value in table.entries} for whose, table in tables.items()}


def _claim(words: TomlTable) -> Claim:
    kind = next((kind for kind, keys in CLAIMS.items() if words.has(keys[0])), None)
    if kind is None:
        words.only((*COMMON, *dict.fromkeys(key for keys in CLAIMS.values() for key in keys)))
        raise words.lacks("less", "what it is about: one of of, less and than, alike and to, grows, crosses")
    words.only((*COMMON, *CLAIMS[kind]))
    common: dict[str, Any] = {
        "says": words.text("says"),
        "measure": words.text("measure"),
        "each": words.text("each", ""),
        "where": _selection(words, "where"),
    }
    if kind == "less":
        first, second = _selection(words, "less"), _side(words, "than")
        return Claim("less", first=first, second=second, low=words.number("factor", 1.0, above=0), **common)
    if kind == "alike":
        by = 1 + words.number("by", above=0)
        first, second = _selection(words, "alike"), _side(words, "to")
        return Claim("alike", first=first, second=second, low=1 / by, high=by, **common)
    low, high = _bounds(words, needed=kind != "crosses")
    if kind == "crosses":
        first, second = _side(words, "less"), _side(words, "than")
        return Claim("crosses", first=first, second=second, low=low, high=high, along=words.text("crosses"), **common)
    along = words.text("grows") if kind == "grows" else ""
    return Claim(kind, first=_selection(words, "of"), second={}, low=low, high=high, along=along, **common)  # pyright: ignore[reportArgumentType] - value or grows  # ty: ignore[invalid-argument-type]


def _bounds(words: TomlTable, *, needed: bool) -> tuple[float, float]:
    if not words.has("within"):
        low, high = words.number("above", -inf), words.number("below", inf)
        if needed and not (words.has("above") or words.has("below")):
            raise words.lacks("above", "above, below or within = [low, high]")
        if low > high:
            raise words.fault("above", f"less than below, which is {shown(words.entries['below'])}")
        return low, high
    for other in ("above", "below"):
        if words.has(other):
            raise words.refused(other, "is given beside within, expected one or the other.")
    low, high = words.numbers("within", 2).tolist()
    if low >= high:
        raise words.fault("within", "two numbers, the lower one first")
    return low, high


def _side(words: TomlTable, key: str) -> dict[str, Any]:
    if not words.has(key):
        raise words.lacks(key, f'the cells to compare with, as in {key} = {{ backend = "ekf" }}')
    return _selection(words, key)


def _selection(words: TomlTable, key: str) -> dict[str, Any]:
    """Reads a selection: parameter -> value."""
    inside = words.table(key)
    for name, value in inside.entries.items():
        if isinstance(value, dict):
            raise inside.fault(name, 'a value; a name with a dot goes in quotes, "dataset.x"')
        if not isinstance(value, str | int | float):
            raise inside.fault(name, "a number, a text, true or false")
        if name == "measure":
            inside.text(name)
    return dict(inside.entries)


Size = Literal["quick", "full"]


def sized(file: TomlTable, size: Size) -> TomlTable:
    """The file in that size; InputError for other sizes, and a number beyond 64 bits."""
    lines, found = file.lines(), dict[Place, int]()

    def chosen(value: Any, stood: Place, place: Place) -> Any:
        """The value that `stood` in the file and has the `place` in what is left."""
        if stood in lines:
            found[place] = lines[stood]
        if isinstance(value, dict) and ("quick" in value or "full" in value):
            if set(value) != {"quick", "full"}:
                given = f"{called(stood) or 'the file'}: found {' and '.join(value)}"
                raise file.at(stood, f"{given}, expected quick and full, each with a value, and nothing else.")
            return chosen(value[size], (*stood, size), place)
        if isinstance(value, dict):
            return {name: chosen(inner, (*stood, name), (*place, name)) for name, inner in value.items()}
        if isinstance(value, list):
            return [chosen(inner, (*stood, k), (*place, k)) for k, inner in enumerate(value)]
        if isinstance(value, int) and abs(value) > LARGEST:
            raise file.at(stood, f"found {shown(value)}, expected {LARGEST:,} at most.")
        return value

    try:
        entries = chosen(file.entries, (), ())
    except RecursionError:
        raise too_deep(file.file) from None
    return replace(file, lines=lambda: found, entries=entries)
