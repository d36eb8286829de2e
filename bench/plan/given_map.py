"""Gives the map of an earlier run, or of a file of landmarks, as the prior of every log of a run.

A record keeps the joint covariance of its maps, so localisation starts from all that the mapping run knew. A map.csv
has the covariance of each landmark alone, and landmarks.csv none: such a map is held fixed.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Log, Map, Start
from ...core.se2 import Array
from ...datasets import registry as datasets
from ..record.schema import FILE, Row, label
from ..record.store import Store
from ..words.numerals import counted
from .landmark_file import block_diagonal, read_landmarks
from .variant import DatasetVariant

NAMED = 6  # cells that are named where one has to be chosen

ARRAYS = tuple(f"{which}_{part}" for which in ("final_map", "map") for part in ("ids", "xy", "cov", "joint"))
"""the arrays of a cell's maps in a record"""

JOINT, BLOCKS, FIXED = "with its joint covariance", "with the covariance of each landmark alone", "held fixed"


@dataclass(frozen=True)
class GivenMap:
    """The map, or one map per seed, that every log of a run starts from."""

    source: str  # as it was named
    fixed: bool  # its covariance is ignored
    maps: Mapping[int, Map]  # by the seed of the log it was made from
    kinds: frozenset[str]  # what is known of their covariances
    world: str  # the dataset it was made from, if each of its seeds is another world; else ""
    made_of: str = ""  # that dataset with its options, "" for a file
    start: Start = "known"  # of the robot on it

    def seeds(self, dataset: DatasetVariant, wanted: Iterable[int]) -> list[int]:
        """Returns those of `wanted` whose log is of a world that was mapped; InputError where there is none."""
        if not self._by_seed(dataset):
            if len(self.maps) > 1:
                raise InputError(
                    f"--map {self.source}: holds a map for each of {len(self.maps)} seeds of {self.world}, expected "
                    f"the folder of one cell for {dataset.label}, which has no such seeds."
                )
            return list(wanted)
        found = [seed for seed in wanted if seed in self.maps]
        if not found:
            raise InputError(
                f"--map {self.source}: is of {self.world}, seed {min(self.maps)}, whose world no other seed has; "
                f"expected --seeds {min(self.maps) + 1} or more."
            )
        return found

    def of(self, dataset: DatasetVariant, seed: int) -> Map:
        """The map for a log."""
        return self.maps[seed] if self._by_seed(dataset) else next(iter(self.maps.values()))

    @property
    def digest(self) -> str:
        """The sha256 of all its numbers, in hexadecimal."""
        total = hashlib.sha256()
        for seed, known in sorted(self.maps.items()):
            total.update(f"{seed} {len(known.ids)} {known.cov is not None}\n".encode())
            total.update(b"unknown start\n" * (self.start == "unknown"))
            for column in known if known.cov is not None else known[:2]:
                total.update(np.ascontiguousarray(column).tobytes())
        return total.hexdigest()

    def words(self) -> str:
        """Describes the map for a report."""
        sizes = sorted({len(known.ids) for known in self.maps.values()})
        many = f"{sizes[0]} to {sizes[-1]} landmarks" if len(sizes) > 1 else counted(sizes[0], "landmark")
        start = ", the start on it unknown" if self.start == "unknown" else ""
        return f"{many} from {self.source}, {' or '.join(sorted(self.kinds))}{start}"

    def _by_seed(self, dataset: DatasetVariant) -> bool:
        return bool(self.world) and dataset.name == self.world


def read(source: str, *, fixed: bool, start: Start = "known") -> GivenMap:
    """Reads the map in `source`: a folder of a run or cell, all seeds as *, or a CSV file of landmarks.

    InputError names the file, and the row, of what cannot be used, or the cells to choose from, and where a map without
    covariance is not said to be exact for an unknown `start`.
    """
    found = replace(_read(source, fixed), start=start)
    if start == "unknown" and not fixed and any(known.cov is None for known in found.maps.values()):
        raise InputError(
            f"--start unknown: the map of {source} has no covariance, expected one with; --map-fixed says that it is "
            "exact."
        )
    return found


def _read(source: str, fixed: bool) -> GivenMap:
    path = Path(source)
    if path.is_file():
        known = read_landmarks(path)
        return _given(source, fixed, {0: _Known(known, FIXED if known.cov is None else BLOCKS)}, "", "")
    for folder in (path, *path.resolve().parents[:3]):
        if (folder / FILE).is_file():
            return _from_record(source, fixed, folder, path)
    expected = "expected the folder of a run, or of one of its cells, or a file with the columns id,x,y"
    raise InputError(f"--map {source}: there is no {'map here' if path.exists() else 'such place'}; {expected}.")


def localising(log: Log, known: Map, where: str, start: Start = "known") -> Log:
    """Puts the map, and what is known of the start, into the log's prior; InputError where it has a map already."""
    if log.prior.map is not None:
        raise InputError(f"--map: {where} has a map of its own in its prior, expected a log without.")
    return replace(log, prior=log.prior._replace(map=known, start=start))


GRIDS = "bench map writes the grids of a run on laser logs"


class _Known(NamedTuple):
    map: Map
    kind: str


def _given(source: str, fixed: bool, found: Mapping[int, _Known], world: str, made_of: str) -> GivenMap:
    if fixed:
        found = {seed: _Known(known.map._replace(cov=None), FIXED) for seed, known in found.items()}
    maps = {seed: _checked(known.map, source) for seed, known in found.items()}
    return GivenMap(source, fixed, maps, frozenset(known.kind for known in found.values()), world, made_of)


def _checked(known: Map, source: str) -> Map:
    """Makes the arrays read-only; InputError unless the covariance is positive definite."""
    if known.cov is not None:
        try:
            np.linalg.cholesky(known.cov)
        except np.linalg.LinAlgError:
            raise InputError(
                f"--map {source}: its covariance is not positive definite, expected one that is; --map-fixed does "
                "without."
            ) from None
    for column in known:
        if column is not None:
            column.flags.writeable = False
    return known


def _from_record(source: str, fixed: bool, folder: Path, path: Path) -> GivenMap:
    """Reads the maps of one backend on one dataset: of all seeds that `path` covers, if each is another world."""
    found: dict[Path, Row] = {}
    with_map: list[Path] = []
    with Store(folder) as store:
        slugs: dict[str, str] = store.run()["folders"]
        for row in store.cells():
            place = _place(row, slugs)
            if row.columns["status"] == "done" and row.columns["landmarks"]:
                with_map.append(folder / place)
                if _covers(path, folder / place):
                    found[place] = row
        if not found:
            have = f"expected {_named(with_map)}." if with_map else f"and no other cell of {folder} has one; {GRIDS}."
            raise InputError(f"--map {source}: found no cell with a map, {have}")
        first = next(iter(found.values())).columns
        world = first["dataset"] if datasets.seeded(first["dataset"]) else ""
        if len(found) > 1 and (not world or len({row.key[:4] for row in found.values()}) > 1):
            named = _named([folder / place for place in found])
            raise InputError(f"--map {source}: holds {len(found)} maps, expected {named}.")
        maps = {row.columns["seed"]: _from_arrays(_sound(store, row, source)) for row in found.values()}
    return _given(source, fixed, maps, world, label(first["dataset"], first["dataset_options"]))


def _named(cells: Sequence[Path]) -> str:
    more = f" and {len(cells) - NAMED} more" if len(cells) > NAMED else ""
    return ("one of: " if len(cells) > 1 else "") + f"{', '.join(map(str, cells[:NAMED]))}{more}"


def _sound(store: Store, row: Row, source: str) -> dict[str, Any]:
    """Reads the arrays of a cell's map; InputError where the record has none."""
    arrays = store.arrays(row, ARRAYS)
    if not any(name in arrays for name in ("map_ids", "final_map_ids")):
        raise InputError(f"--map {source}: the study keeps no maps, expected one with keep = true, or a run.")
    return arrays


def _place(row: Row, slugs: Mapping[str, str]) -> Path:
    c = row.columns
    dataset, backend = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
    return Path(slugs[dataset], str(c["seed"]), slugs[backend])


def _covers(path: Path, place: Path) -> bool:
    """True if `place` is `path` or in it; a part of `path` may be *, for any seed."""
    parts, wanted = place.resolve().parts, path.resolve().parts
    return len(wanted) <= len(parts) and all(w in (part, "*") for w, part in zip(wanted, parts, strict=False))


def _from_arrays(arrays: Mapping[str, Any]) -> _Known:
    """The map of a cell: the one with the most covariance, the final one of two alike."""
    prefixes = [prefix for prefix in ("final_map", "map") if f"{prefix}_ids" in arrays]
    for kind, ending in ((JOINT, "joint"), (BLOCKS, "cov")):
        for prefix in prefixes:
            if f"{prefix}_{ending}" in arrays:
                stored = arrays[f"{prefix}_{ending}"]
                cov = _mirrored(stored) if kind == JOINT else block_diagonal(stored)
                return _Known(Map(arrays[f"{prefix}_ids"], arrays[f"{prefix}_xy"], cov), kind)
    return _Known(Map(arrays[f"{prefixes[0]}_ids"], arrays[f"{prefixes[0]}_xy"], None), FIXED)


def _mirrored(triangle: Array) -> Array:
    m = (int(np.sqrt(8 * len(triangle) + 1)) - 1) // 2
    whole = np.zeros((m, m))
    whole[np.triu_indices(m)] = triangle
    return np.triu(whole, 1).T + whole
