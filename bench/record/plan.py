"""A record's plan: its cells, the text of their parameters, and the status of those without a result."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from .schema import SKIPPED


class Planned(NamedTuple):
    """A planned cell of the record."""

    key: tuple[str, str, str, str, int]  # dataset, its options, backend, its options, seed
    parameters: Mapping[str, Any]
    log: str  # the key of its log
    result: str | None  # the key of its result, once that is known


def status_of(trouble: str | None) -> str:
    """The status of a cell without a result."""
    return "waiting" if trouble is None else "skipped" if trouble.startswith(SKIPPED) else "error"


def encoded_parameters(parameters: Mapping[str, Any], known: dict[str, str]) -> str:
    """Encodes parameters as JSON, without the seed, which has a column; `known` caches texts."""
    rest = {name: value for name, value in parameters.items() if name != "seed"}
    spelt = repr(rest)
    if spelt not in known:
        known[spelt] = json.dumps(rest)
    return known[spelt]
