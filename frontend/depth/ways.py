"""The motion between any two steps, as well as it is known: along the way of least variance, over steps and loops."""

from heapq import heappop, heappush

import numpy as np

from .gate import back, chained
from .planar import Planar


class Ways:
    """Motions between the steps, as edges of a graph."""

    def __init__(self) -> None:
        self._edges: list[list[tuple[int, float, Planar]]] = [[]]  # of each step: to, variance, motion

    def __len__(self) -> int:
        return len(self._edges)

    def step(self, motion: Planar) -> None:
        """Adds a step, with the motion since the one before."""
        self._edges.append([])
        self.join(len(self._edges) - 2, len(self._edges) - 1, motion)

    def join(self, first: int, second: int, motion: Planar) -> None:
        """Adds the motion from one step to another."""
        variance = float(np.trace(motion.cov))  # a radian moves what is a metre away by a metre
        self._edges[first].append((second, variance, motion))
        self._edges[second].append((first, variance, back(motion)))

    def motion(self, first: int, second: int) -> Planar:
        """The motion from one step to another. Dijkstra's algorithm; no edge is on the way twice."""
        least, came = {first: 0.0}, dict[int, tuple[int, Planar]]()
        waiting, done = [(0.0, first)], set[int]()
        while waiting:
            variance, at = heappop(waiting)
            if at == second:
                break
            if at in done:
                continue
            done.add(at)
            for to, more, edge in self._edges[at]:
                if variance + more < least.get(to, np.inf):
                    least[to], came[to] = variance + more, (at, edge)
                    heappush(waiting, (variance + more, to))
        way = list[Planar]()
        while second != first:
            second, edge = came[second]
            way.append(edge)
        way.reverse()
        return chained(
            np.array([edge.delta for edge in way]).reshape(-1, 3), np.array([edge.cov for edge in way]).reshape(-1, 3, 3)
        )
