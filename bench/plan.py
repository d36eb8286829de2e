"""What a run consists of: dataset variants x backend variants x seeds, as cells."""

import random
from dataclasses import dataclass
from typing import Any

from .spec import BackendVariant, DatasetVariant, backend_variants, dataset_variants


@dataclass(frozen=True)
class Cell:
    """One backend on one log."""

    dataset: DatasetVariant
    backend: BackendVariant
    seed: int

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        """As in the record."""
        return self.dataset.name, self.dataset.given, self.backend.name, self.backend.given, self.seed

    def __str__(self) -> str:
        return f"{self.dataset.label} · {self.backend.label} · seed {self.seed}"


@dataclass(frozen=True)
class Plan:
    """A run as it was asked for."""

    backends: tuple[BackendVariant, ...]
    datasets: tuple[DatasetVariant, ...]
    seeds: int
    timeout_s: float
    memory_mb: int

    def cells(self) -> list[Cell]:
        """All cells, in an order that is shuffled but always the same.

        Where neither the log nor the backend draws random numbers every seed would give the same cell: it is run once.
        """
        cells = [
            Cell(dataset, backend, seed)
            for dataset in self.datasets
            for backend in self.backends
            for seed in range(self.seeds if dataset.source.seeded or _random(backend) else 1)
        ]
        random.Random(0).shuffle(cells)
        return cells

    def words(self) -> dict[str, Any]:
        """The plan in the words of the command line, from which `from_words` makes it again."""
        return {
            "backend": ",".join(variant.label for variant in self.backends),
            "dataset": ",".join(variant.label for variant in self.datasets),
            "seeds": self.seeds,
            "timeout_s": self.timeout_s,
            "memory_mb": self.memory_mb,
        }

    @classmethod
    def from_words(cls, words: dict[str, Any]) -> "Plan":
        """InputError where a name or an option is not right."""
        return cls(
            tuple(backend_variants(words["backend"])),
            tuple(dataset_variants(words["dataset"])),
            words["seeds"],
            words["timeout_s"],
            words["memory_mb"],
        )


def _random(backend: BackendVariant) -> bool:
    return backend.builder is not None and backend.builder.random
