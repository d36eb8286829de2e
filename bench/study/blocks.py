"""Reads the [[cells]] of a study file: datasets x backends x swept options x seeds, as combinations of cells."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from ...core.errors import InputError, nearest
from ...core.toml.lines import Place
from ...core.toml.table import TomlTable, shown
from ..plan.plan import Cell
from ..plan.spec import backend_variants, dataset_variants, read_values
from ..plan.values import MOST_CELLS, too_many
from ..plan.variant import BackendVariant, DatasetVariant, Variant
from ..plan.work import PlannedCell

KEYS = ("dataset", "backend", "seeds", "first_seed", "grid", "zip", "list", "timed")
TAKEN = ("dataset", "backend", "seed", "status", "reason")  # not names of options: swept, they go by full names


class Combination(NamedTuple):
    """The cells of a study that differ by their seed alone."""

    dataset: DatasetVariant
    backend: BackendVariant
    parameters: Mapping[str, Any]  # dataset, backend, seed (0), then what is swept
    seeds: Sequence[int]
    timed: bool
    key: tuple[Any, ...]  # another for all that are not the same cells

    def cells(self) -> Iterator[PlannedCell]:
        """Yields one cell per seed."""
        for seed in self.seeds:
            yield PlannedCell(Cell(self.dataset, self.backend, seed), {**self.parameters, "seed": seed}, self.timed)


class _Side:
    """A dataset or a backend as named in the file, and its variants by swept options."""

    def __init__(self, words: TomlTable, side: str, label: str, place: Place) -> None:
        self.words, self.side, self.label, self.place = words, side, label, place
        try:
            found = dataset_variants(label, side) if side == "dataset" else backend_variants(label, side)
        except InputError as error:
            raise words.at(place, str(error)) from None
        if len(found) > 1:
            raise words.at(place, f"{side}: found {label!r}, expected one per text; several go in a list.")
        self.base: Any = found[0]
        self.missing = isinstance(self.base, BackendVariant) and self.base.builder is None
        self.variants: dict[tuple[Any, ...], tuple[Variant, str]] = {}

    def has(self, option: str) -> bool:
        """True if it has that option; assumed of one that cannot be imported."""
        return self.missing or hasattr(self.base.options, option)

    def set(self, option: str) -> bool:
        """True if its label gives the option a value."""
        inside = self.label.partition("[")[2].removesuffix("]")
        return any(pair.partition("=")[0].strip() == option for pair in inside.split(","))

    def read(self, option: str, value: Any, place: Place) -> Any:
        """Reads the option's value by itself; InputError for an invalid one."""
        if self.missing:
            return value
        try:
            pairs = [(option, str(value).lower() if isinstance(value, bool) else str(value))]
            return read_values(type(self.base.options), pairs, f"{self.side} {self.base.name}")[option]
        except InputError as error:
            raise self.words.at(place, str(error)) from None

    def variant(self, swept: Mapping[str, Any]) -> tuple[Any, str]:
        """The variant with these values, already read, and its label; the same object for the same values.

        InputError where options refuse each other.
        """
        key = tuple(swept.items())
        if key not in self.variants:
            try:
                options = self.base.options if self.missing else replace(self.base.options, **swept)
            except InputError as error:
                raise self.words.at(self.place, str(error)) from None
            made = replace(self.base, options=options)
            self.variants[key] = made, f"{made.label}{key}" if self.missing else made.label
        return self.variants[key]


@dataclass(frozen=True)
class _Block:
    """One [[cells]]; every axis is a list of what one step along it sets."""

    words: TomlTable
    datasets: list[_Side]
    backends: list[_Side]
    axes: list[list[dict[str, tuple[Any, Place]]]]
    seeds: Sequence[int]

    @property
    def swept(self) -> list[str]:
        """The full names of the swept options."""
        return list(dict.fromkeys(name for axis in self.axes for step in axis for name in step))


def combinations(file: TomlTable, *, timed: bool) -> list[Combination]:
    """Reads the combinations of all [[cells]]; InputError for missing, invalid or repeated ones."""
    blocks = [_block(words, file) for words in file.tables("cells", "[[cells]] with a dataset and a backend")]
    if not blocks:
        raise file.lacks("cells", "[[cells]] with a dataset and a backend")
    names = _names(dict.fromkeys(name for block in blocks for name in block.swept))
    found: list[Combination] = []
    before: dict[tuple[Any, ...], list[tuple[Sequence[int], TomlTable]]] = {}
    _check_number(blocks)
    for block in blocks:
        timed_too = block.words.switch("timed", timed)
        for one in _combined(block, names, timed=timed_too):
            for seeds, words in before.setdefault(one.key, []):
                if not set(seeds).isdisjoint(one.seeds):
                    line = words.line((*words.place, "dataset"))
                    where = "twice" if words is block.words else f"of line {line} already"
                    said = f"{one.dataset.label} with {one.backend.label} is a cell {where}"
                    raise block.words.refused("dataset", f"{said}, expected every cell once in a study.")
            before[one.key].append((one.seeds, block.words))
            found.append(one)
    return found


def _check_number(blocks: Iterable[_Block]) -> None:
    """Raises InputError for too many cells, before any of them is made."""
    count = 0
    for block in blocks:
        lengths = [len(block.datasets), len(block.backends), *map(len, block.axes), len(block.seeds)]
        count += math.prod(lengths)
        if wrong := too_many(count):
            raise block.words.refused("dataset", wrong)


def _combined(block: _Block, names: Mapping[str, str], *, timed: bool) -> Iterator[Combination]:
    read: dict[tuple[int, str, Any, type], Any] = {}

    def variant(side: _Side, name: str, together: Mapping[str, tuple[Any, Place]]) -> tuple[Any, str]:
        chosen: dict[str, Any] = {}
        for full, (value, place) in together.items():
            if full.startswith(f"{name}."):
                key = (id(side), full, value, type(value))
                if key not in read:
                    read[key] = side.read(full.partition(".")[2], value, place)
                chosen[full.partition(".")[2]] = read[key]
        return side.variant(chosen)

    sides = itertools.product(block.datasets, block.backends)
    for (dataset, backend), steps in itertools.product(sides, itertools.product(*block.axes)):
        together = {name: found for step in steps for name, found in step.items()}
        d, d_label = variant(dataset, "dataset", together)
        b, b_label = variant(backend, "backend", together)
        parameters: dict[str, Any] = {"dataset": dataset.label, "backend": backend.label, "seed": 0}
        for full, name in names.items():
            side, _, option = full.partition(".")
            options = d.options if side == "dataset" else b.options
            if hasattr(options, option):
                value = getattr(options, option)
                parameters[name] = "none" if value is None else value
            else:
                parameters[name] = together[full][0] if full in together else None
        seeds = d.seeds(block.seeds, random=b.builder is not None and b.builder.random)
        yield Combination(d, b, parameters, seeds, timed, (d_label, b_label))


def _names(swept: Iterable[str]) -> dict[str, str]:
    """Names the parameters by the full names of the options: x for backend.x where only one side has it."""
    short = [name.partition(".")[2] for name in swept]
    return {
        full: full if short.count(name) > 1 or name in TAKEN else name for full, name in zip(swept, short, strict=True)
    }


def _block(words: TomlTable, file: TomlTable) -> _Block:
    words.only(KEYS)
    sides = {side: _sides(words, side) for side in ("dataset", "backend")}
    axes = [[{name: step} for step in steps] for name, steps in _columns(words.table("grid"), distinct=True).items()]
    axes += [*_zip(words), *_list(words)]
    block = _Block(words, sides["dataset"], sides["backend"], axes, _seeds(words, file))
    by: dict[str, Place] = {}
    for axis in axes:
        for name, (_, place) in {name: found for step in axis for name, found in step.items()}.items():
            if name in by:
                raise words.at(place, f"{name} is swept here and on line {words.line(by[name])}, expected once.")
            by[name] = place
            _check_option(words, name, place, sides)
    return block


def _sides(words: TomlTable, side: str) -> list[_Side]:
    labels = words.names(side)
    places = [(*words.place, side, k) for k in range(len(labels))]
    for k, (label, place) in enumerate(zip(labels, places, strict=True)):
        if label in labels[:k]:
            raise words.at(place, f"{side}: found {label!r} twice, expected once.")
    return [_Side(words, side, label, place) for label, place in zip(labels, places, strict=True)]


def _seeds(words: TomlTable, file: TomlTable) -> Sequence[int]:
    """Reads seeds, a count from the first one or a list, else one; defaults are those of the file."""
    here = words if words.has("seeds") else file
    found = here.entries.get("seeds", 1)
    first = (words if words.has("first_seed") else file).whole("first_seed", 0, 0)
    if type(found) is int and found > MOST_CELLS:
        raise here.fault("seeds", f"at most as many as a study may have cells, {MOST_CELLS:,}")
    if type(found) is int and found >= 1:
        return range(first, first + found)
    if not isinstance(found, list) or not found or not all(type(seed) is int and seed >= 0 for seed in found):
        raise here.fault("seeds", "a whole number, at least 1, or a list of seeds, each at least 0")
    if len(set(found)) < len(found):
        raise here.fault("seeds", "each seed once")
    for one in (words, here):
        if one.has("first_seed"):
            raise one.refused("first_seed", "the seeds are a list, expected how many there are from that one on.")
    return found


def _zip(words: TomlTable) -> list[list[dict[str, tuple[Any, Place]]]]:
    columns = _columns(words.table("zip"), distinct=False)
    lengths = {name: len(steps) for name, steps in columns.items()}
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{length} of {name}" for name, length in lengths.items())
        raise words.refused("zip", f"found values in unequal numbers, {found}; expected as many of each.")
    return (
        [[dict(zip(columns, steps, strict=True)) for steps in zip(*columns.values(), strict=True)]] if columns else []
    )


def _columns(table: TomlTable, *, distinct: bool) -> dict[str, list[tuple[Any, Place]]]:
    """Reads the values of every option, at least one each, and where each stands."""
    found: dict[str, list[tuple[Any, Place]]] = {}
    for name, (values, place) in table.flat().items():
        if not isinstance(values, list) or not values:
            raise table.at(place, f"{name}: found {shown(values)}, expected a list of values, at least one.")
        found[name] = [(_scalar(table, name, value, (*place, k)), (*place, k)) for k, value in enumerate(values)]
        for k, value in enumerate(values):
            if distinct and value in values[:k]:
                raise table.at((*place, k), f"{name}: found {shown(value)} twice, expected every value once.")
    return found


def _list(words: TomlTable) -> list[list[dict[str, tuple[Any, Place]]]]:
    expected = "a list of tables, as in list = [{ dataset.x = 1, backend.y = 2 }]"
    tables = words.tables("list", expected)
    if words.has("list") and not (tables and all(table.entries for table in tables)):
        raise words.fault("list", f"{expected}, none of them empty")
    steps = [
        {name: (_scalar(table, name, value, place), place) for name, (value, place) in table.flat().items()}
        for table in tables
    ]
    return [steps] if steps else []


def _scalar(words: TomlTable, name: str, value: Any, place: Place) -> Any:
    if not isinstance(value, str | int | float):
        raise words.at(place, f"{name}: found {shown(value)}, expected a number, a text, true or false.")
    return value


def _check_option(words: TomlTable, full: str, place: Place, sides: Mapping[str, Sequence[_Side]]) -> None:
    """Raises InputError unless every dataset, or backend, of the block has the option, and none sets it already."""
    side, _, option = full.partition(".")
    if side not in sides or not option:
        raise words.at(place, f'{full!r}: expected the name of an option, as in "dataset.x" or "backend.x".')
    lacking = [one for one in sides[side] if not one.has(option)]
    if lacking and len(lacking) == len(sides[side]):
        options = vars(lacking[0].base.options)
        name = lacking[0].base.name
        raise words.at(place, f"{full}: {side} {name} has no option {option!r}; {nearest(option, options)}")
    if lacking:
        has = [one.label for one in sides[side] if one.has(option)]
        raise words.at(
            place,
            f"{full}: {side} {lacking[0].label} has no option {option!r}, expected it of every {side} of the block; "
            f"give {', '.join(has)} a [[cells]] of {'its' if len(has) == 1 else 'their'} own.",
        )
    for one in sides[side]:
        if one.set(option):
            raise words.at(place, f"{full}: {one.label!r} has a value of it already, expected one or the other.")
