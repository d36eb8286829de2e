"""Remarks on logs, put together by dataset."""

import json
from collections.abc import Iterable, Sequence

from .schema import label

NAMED = 12  # seeds that are named


def by_label(rows: Iterable[tuple[str, str, int, str | None]]) -> dict[str, list[str]]:
    """The remarks by dataset label, with the seeds of which each is said if not of all.

    A row has a log's dataset, options and seed, and its remarks as JSON. ValueError where these are no list of texts.
    """
    seeds: dict[str, dict[str, list[int]]] = {}
    logs: dict[str, int] = {}
    for dataset, options, seed, found in rows:
        name = label(dataset, options)
        logs[name] = logs.get(name, 0) + 1
        said = json.loads(found or "[]")
        if not isinstance(said, list) or not all(isinstance(one, str) for one in said):
            raise ValueError(f"the remarks on {name} are {said!r:.40}, expected a list of texts")
        for remark in said:
            seeds.setdefault(name, {}).setdefault(remark, []).append(seed)
    return {name: [_of_seeds(*one, logs[name]) for one in said.items()] for name, said in seeds.items()}


def _of_seeds(remark: str, seeds: Sequence[int], logs: int) -> str:
    """Puts the seeds in front of a remark, unless it is on every log."""
    if len(seeds) == logs:
        return remark
    return (
        f"seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds[:NAMED]))}{', ...' * (len(seeds) > NAMED)}: {remark}"
    )
