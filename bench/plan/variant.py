"""Backends and datasets with their options resolved, and the logs of a dataset by their seeds."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

from ...backends.api import Builder
from ...core.errors import InputError
from ...datasets import registry as datasets
from ...datasets.registry import Member, Source
from ..words.names import short

LONGEST = 40  # characters of a folder's name, before its hash

PARTED = ";"
"""Between the values of an option that has several: commas are between options."""


@dataclass(frozen=True)
class Variant:
    """A backend or dataset with its options resolved."""

    name: str
    options: Any  # the options' dataclass

    @cached_property
    def given(self) -> str:
        """The options that differ from their defaults, as `name=value,...`."""
        changed = [
            (field.name, int(value) if field.metadata.get("pointless") and value == value // 1 else value)
            for field in fields(self.options)
            if (value := getattr(self.options, field.name)) != field.default
        ]
        texts = [(name, text_of(value)) for name, value in changed]
        odd = {text for _, text in texts if any(c in text for c in ",[]") or text != text.strip()}
        return ",".join(f'{name}="{text}"' if text in odd else f"{name}={text}" for name, text in texts)

    @cached_property
    def label(self) -> str:
        """The name, and in brackets the options that differ from their defaults, as on the command line."""
        return f"{self.name}[{self.given}]" if self.given else self.name

    @property
    def slug(self) -> str:
        """The label as the name of a folder: with options, the name and a short hash; of a log from files, its own."""
        called = short(self.label)
        name = self.name if called == self.label else called
        plain = "".join(c if c.isalnum() or c in "-_." else "-" for c in name).strip("-.")[:LONGEST]
        if plain == self.name and not self.given:
            return plain
        return f"{plain or self.name}-{hashlib.sha256(self.label.encode()).hexdigest()[:8]}"


@dataclass(frozen=True)
class BackendVariant(Variant):
    """A backend; `builder` is None, and `missing` says why, for a known name that cannot be imported."""

    builder: Builder | None
    missing: str = ""


@dataclass(frozen=True)
class DatasetVariant(Variant):
    """A dataset: one log, a log per seed, or the logs of `members`, which the seeds then number."""

    source: Source
    members: tuple[Member, ...] = ()

    def log(self, seed: int) -> "OneLog":
        """The log of a seed; InputError beyond the logs of a dataset of many."""
        if not self.members:
            return OneLog(self, seed if self.source.draws(self.options) else 0)
        if len(self.members) > 1 and seed >= len(self.members):
            last = len(self.members) - 1
            raise InputError(
                f"dataset {self.label}: found seed {seed}, expected 0 to {last}, one for each of its logs."
            )
        name, options, called, cluster, drawn_with = self.members[seed if len(self.members) > 1 else 0]
        return OneLog(DatasetVariant(name, options, datasets.find(name)), drawn_with, called, cluster)

    @property
    def numbered(self) -> bool:
        """True where each seed is another log."""
        return len(self.members) > 1 or (self.source.draws(self.options) and not self.members)

    def seeds(self, wanted: Sequence[int], *, random: bool) -> Sequence[int]:
        """The seeds that a backend runs with, `random` or not: of a dataset of many logs, all of them.

        Of any other dataset those `wanted`, the first one alone where neither log nor backend is random.
        """
        if len(self.members) > 1:
            return range(len(self.members))
        return wanted if self.numbered or random else wanted[:1]


class OneLog(NamedTuple):
    """One log of a dataset."""

    dataset: DatasetVariant  # that makes it, alone
    seed: int  # that it is made with
    name: str | None = None  # tells it from the others of a dataset of many
    cluster: str | None = None  # that it belongs to

    def __str__(self) -> str:
        return self.dataset.label + f", seed {self.seed}" * self.dataset.source.draws(self.dataset.options)


def text_of(value: Any) -> str:
    """Writes the value of an option as on the command line."""
    if isinstance(value, tuple):
        return PARTED.join(map(text_of, value))
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
