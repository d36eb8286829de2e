"""The paths of all particles as a tree, as descendants of one particle share its past.

Jacob, Murray and Rubenthaler, "Path storage in the particle filter" (Statistics and Computing, 2015): branches that die
out are removed at once, which leaves about n + c M log M poses of n steps of M particles, instead of n M.
"""

from typing import Any

import numpy as np

from ...core.se2 import Ints
from ._ancestry import Values, forebears, grow

NO_POSES = np.zeros((0, 3))


class ParticlePaths:
    """Every particle's poses back to the start; 36 bytes per pose of a living branch, with space for twice as many.

    No branch dies while particles are not resampled: then M poses are stored per step. Values other than poses are
    stored as rows of `nodes` (0, C), which says how many there are and of which type.
    """

    def __init__(self, particles: int, nodes: Any = NO_POSES) -> None:
        self._nodes = nodes  # of each node its pose
        self._parents = np.zeros(0, np.int32)  # the node of the step before, -1 at the start
        self._children = np.zeros(0, np.int32)  # number of children of a node
        self._unused = np.zeros(0, np.int32)  # a stack of nodes
        self._left = 0  # its height
        self._leaves = np.full(particles, -1, np.int32)  # the node of each particle's last pose
        self._ancestors: Ints | None = None
        self.steps = 0  # so far

    def resampled(self, ancestors: Ints) -> None:
        """Replaces each particle m by a copy of particle ancestors[m]."""
        self._ancestors = ancestors if self._ancestors is None else self._ancestors[ancestors]

    def add(self, values: Values) -> None:
        """Appends the particles' poses (3 or more, M): x, y, heading; further rows are ignored."""
        if self._left < len(self._leaves):
            self._reserve()
        ancestors = np.arange(len(self._leaves)) if self._ancestors is None else self._ancestors
        self._ancestors = None
        self.steps += 1
        self._left = grow(
            self._nodes, self._parents, self._children, self._unused, self._left, self._leaves, ancestors, values
        )

    def at(self, steps: Ints) -> Any:
        """(n, C, M) every particle's poses at n of the steps so far."""
        order = np.argsort(-steps, kind="stable")
        nodes = np.empty((len(steps), len(self._leaves)), np.int32)
        ancestors = np.arange(len(self._leaves)) if self._ancestors is None else self._ancestors
        forebears(self._parents, self._leaves, ancestors, self.steps - 1 - steps[order], nodes)
        found = np.empty((len(steps), self._nodes.shape[1], len(self._leaves)), self._nodes.dtype)
        found[order] = self._nodes[nodes].transpose(0, 2, 1)
        return found

    def path(self, particle: int) -> Any:
        """(n, 3) the poses of that particle and its ancestors, from the start."""
        nodes: list[int] = []
        node = int(self._leaves[particle if self._ancestors is None else self._ancestors[particle]])
        while node >= 0:
            nodes.append(node)
            node = int(self._parents[node])
        return self._nodes[nodes[::-1]]

    def _reserve(self) -> None:
        """Doubles the space for nodes."""
        before = len(self._nodes)
        more = max(before, 2 * len(self._leaves))
        self._nodes = np.concatenate((self._nodes, np.zeros((more, self._nodes.shape[1]), self._nodes.dtype)))
        self._parents = np.concatenate((self._parents, np.zeros(more, np.int32)))
        self._children = np.concatenate((self._children, np.zeros(more, np.int32)))
        unused = np.arange(before + more - 1, before - 1, -1, dtype=np.int32)
        self._unused = np.concatenate((self._unused[: self._left], unused, np.zeros(before - self._left, np.int32)))
        self._left += more
