"""Chooses the looks of a study figure's lines: backends as everywhere, numbers in an ordered palette."""

from collections.abc import Iterable, Mapping
from typing import Any

from ..claims.curves import Medians
from ..words.styles import MARKERS, Look, looks

ORDERED = ("#2f74d0", "#6f62d2", "#a553bd", "#c94b8c", "#d5554f", "#c76d1e", "#a5820c")  # blue to ochre


def line_looks(found: Medians, backends: Iterable[Any]) -> Mapping[Any, Look]:
    """Assigns looks to the figure's `bys`, or `xs` where they are backends, alike in all figures of the study."""
    if "backend" in (found.figure.x, found.figure.by):
        return looks(map(str, backends))
    if not found.ordered:
        return dict(zip(found.bys, looks(map(str, found.bys)).values(), strict=True))
    known = [by for by in found.bys if by is not None]
    rising = {by: _rising(k, len(known)) for k, by in enumerate(known)}
    return rising | {None: Look("#8c8c8c", (0, (4, 2)), ".", len(known))}


def _rising(k: int, n: int) -> Look:
    """The k-th look of n."""
    place = k * (len(ORDERED) - 1) / max(n - 1, 1)
    low, share = int(place), place % 1
    ends = (ORDERED[low], ORDERED[min(low + 1, len(ORDERED) - 1)])
    channels = [[int(end[i : i + 2], 16) for end in ends] for i in (1, 3, 5)]
    colour = "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in channels)
    return Look(colour, "-", MARKERS[k % len(MARKERS)], k)
