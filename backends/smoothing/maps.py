"""The map of a forest, with the joint covariance of its landmarks."""

import numpy as np

from ...frontend.factors import Map
from ...frontend.se2 import Array, Ints
from ._graph import WIDTH
from .forest import Forest


def joint_map(forest: Forest, ids: Ints, variables: Ints, values: Array) -> Map:
    """Landmarks with these ids and variables (n,), where `values` (v, 3) has them; zero for what is held fixed."""
    n = len(ids)
    cov = np.zeros((2 * n, 2 * n))
    moving = np.flatnonzero(forest.g.variables[variables, WIDTH])
    if len(moving):
        rows = (2 * moving[:, None] + (0, 1)).ravel()
        cov[np.ix_(rows, rows)] = forest.joint(variables[moving])[:-3, :-3]
    return Map(ids, values[variables, :2], cov)
