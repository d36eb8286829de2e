"""Counts the stretches that stay and lead past a place."""

from collections.abc import Callable

import numpy as np

from ..smoothing._graph import POINT, Graph

BESIDE = 1.0  # m, of a stretch that leads past a place


class Visits:
    """The stretches that stay where loop closures alone locate the robot, by their first and last steps."""

    def __init__(self) -> None:
        self._stretches = list[tuple[int, int]]()

    def add(self, first: int, last: int) -> None:
        """Adds a stretch."""
        self._stretches.append((first, last))

    def of(self, g: Graph, row: Callable[[int], int], first: int, last: int) -> int:
        """The number of them that lead past begin, middle and end of these rows; `row` has that of a step."""
        places, count = g.steps[:, POINT : POINT + 2], 0
        here = places[[first, (first + last) // 2, last]]
        for begin, end in self._stretches:
            there = places[row(begin) : row(end) + 1]
            away = np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1)).min(axis=1)
            count += bool((away <= BESIDE).all())
        return count
