"""The plan of a run: dataset variants x backend variants x seeds, as cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...core.errors import InputError
from ...core.factors import STARTS
from ..words.numerals import listed
from . import given_map
from .given_grid import is_grid, on_grid
from .given_map import GivenMap
from .spec import backend_variants, dataset_variants
from .values import as_choice, as_positive, as_switch, as_text, as_whole, too_many
from .variant import BackendVariant, DatasetVariant, OneLog


@dataclass(frozen=True)
class Cell:
    """One backend on one log."""

    dataset: DatasetVariant
    backend: BackendVariant
    seed: int

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        """The cell's key in the record."""
        return self.dataset.name, self.dataset.given, self.backend.name, self.backend.given, self.seed

    @property
    def log(self) -> OneLog:
        """The log that it runs on."""
        return self.dataset.log(self.seed)

    @property
    def which(self) -> str:
        """Tells the log from the dataset's others: by its name where the dataset names its logs, else by its seed."""
        named = self.log.name if len(self.dataset.members) > 1 else None
        return named or f"seed {self.seed}"

    def __str__(self) -> str:
        return f"{self.dataset.label} · {self.backend.label} · {self.which}"


@dataclass(frozen=True)
class Plan:
    """A run as requested."""

    backends: tuple[BackendVariant, ...]
    datasets: tuple[DatasetVariant, ...]
    seeds: int
    timeout_s: float
    memory_mb: int
    map: GivenMap | None = None  # goes into every log's prior: localisation
    oracle: bool = False  # backends that ask for the ground truth are given it
    repeats: int | None = 1  # rounds in which every cell is timed; None: small ones in several, others once

    def cells(self) -> list[Cell]:
        """Lists all cells; one seed where neither the log nor the backend is random."""
        return [
            Cell(dataset, backend, seed)
            for dataset in self.datasets
            for backend in self.backends
            for seed in self._seeds(dataset, backend)
        ]

    def check_number(self) -> None:
        """Raises InputError for too many cells, before any of them is made."""
        cells = sum(len(self._wanted(d, b)) for d in self.datasets for b in self.backends)
        if wrong := too_many(cells):
            raise InputError(f"seeds: {wrong}")
        if wrong := too_many(cells * (self.repeats or 1)):
            raise InputError(f"repeats: {wrong}")

    def _wanted(self, dataset: DatasetVariant, backend: BackendVariant) -> Sequence[int]:
        random = backend.builder is not None and backend.builder.random
        return dataset.seeds(range(self.seeds), random=random)

    def _seeds(self, dataset: DatasetVariant, backend: BackendVariant) -> Sequence[int]:
        wanted = self._wanted(dataset, backend)
        return wanted if self.map is None else self.map.seeds(dataset, wanted)

    def remarks(self) -> str:
        """Says in sentences which logs and seeds are left out, and where a given map may not fit."""
        sentences: list[str] = []
        for dataset in self.datasets:
            if lacking := dataset.source.absent(dataset.options):
                sentences.append(f"{dataset.label}: not there, and left out: {listed(lacking)}.")
            if self.map is None:
                continue
            made_of = self.map.made_of
            if made_of == dataset.label:
                sentences.append(f"{dataset.label}: the map was made from this very log, whose sightings count twice.")
            elif made_of:
                sentences.append(f"{dataset.label}: the map is of {made_of}, and only helps in the same place.")
            run = self.map.seeds(dataset, range(self.seeds))
            if dataset.numbered and not dataset.members and len(run) < self.seeds:
                seeds = ", ".join(str(seed) for seed in run)
                sentences.append(f"{dataset.label}: of {self.seeds} seeds, only those of the map are run: {seeds}.")
        return " ".join(sentences)

    def words(self) -> dict[str, Any]:
        """Writes the plan in the terms of the command line, from which `from_words` makes it again."""
        return {
            "backend": ",".join(variant.label for variant in self.backends),
            "dataset": ",".join(variant.label for variant in self.datasets),
            "logs": {dataset.label: _logs(dataset) for dataset in self.datasets if dataset.members},
            "seeds": self.seeds,
            "timeout_s": self.timeout_s,
            "memory_mb": self.memory_mb,
            "map": None if self.map is None else self.map.source,
            "map_fixed": self.map is not None and self.map.fixed,
            "start": "known" if self.map is None else self.map.start,
            "map_digest": None if self.map is None else self.map.digest,
            "oracle": self.oracle,
            "repeats": self.repeats,
        }

    @classmethod
    def from_words(cls, words: Any) -> "Plan":
        """Makes a plan; InputError for a name, an option or a limit that is wrong, or not there."""
        known: Any = words if isinstance(words, dict) else {}
        for name in ("backend", "dataset", "seeds", "timeout_s", "memory_mb"):
            if name not in known:
                raise InputError(f"the plan of the run has no {name}, expected what bench run was asked for.")
        found = tuple(dataset_variants(as_text("dataset", words["dataset"])))
        _refuse_other_logs(found, words.get("logs"))
        if is_grid(words.get("map")):
            found, words = on_grid(found, words)
        plan = cls(
            tuple(backend_variants(as_text("backend", words["backend"]))),
            found,
            as_whole("seeds", words["seeds"], 1),
            as_positive("timeout_s", words["timeout_s"]),
            as_whole("memory_mb", words["memory_mb"], 1),
            _map(words),
            as_switch("oracle", words.get("oracle", False)),
            _repeats(words.get("repeats", 1)),  # a run of an earlier version has none
        )
        plan.check_number()
        return plan


def _repeats(given: Any) -> int | None:
    return None if given is None else as_whole("repeats", given, 1)


def _logs(dataset: DatasetVariant) -> list[list[str]]:
    """Writes the logs of a dataset of many with their clusters, "" for none, in the order of their seeds."""
    return [[str(log), log.cluster or ""] for log in map(dataset.log, range(len(dataset.members)))]


def _refuse_other_logs(found: Sequence[DatasetVariant], recorded: Any) -> None:
    """Raises InputError where a dataset of many has not the logs that a run was begun with."""
    known: Any = recorded if isinstance(recorded, dict) else {}
    for dataset in found:
        before, now = known.get(dataset.label), _logs(dataset)
        if before is not None and before != now:
            raise InputError(
                f"dataset {dataset.label}: its logs, or their clusters, have changed since this run was begun: found "
                f"{len(now)}, expected the {len(before)} of then, in that order; run into another folder."
            )


def _map(words: dict[str, Any]) -> GivenMap | None:
    """Reads the given map; InputError where its digest is no longer the recorded one."""
    source, expected = words.get("map"), words.get("map_digest")  # a run of an earlier version has neither
    fixed = as_switch("map_fixed", words.get("map_fixed", False))
    start = as_choice("start", words.get("start", "known"), STARTS)
    if source is None:
        if start == "unknown":
            raise InputError("--start unknown: there is no map to find it on, expected --map beside it.")
        if fixed:
            raise InputError("--map-fixed: there is no map to hold fixed, expected --map beside it.")
        return None
    found = given_map.read(as_text("map", source), fixed=fixed, start=start)
    if expected is not None and found.digest != expected:
        raise InputError(
            f"--map {source}: has changed since this run was begun: its digest is {found.digest[:12]}, expected "
            f"{expected[:12]}; run into another folder."
        )
    return found
