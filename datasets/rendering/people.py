"""People in a rendered building: upright cylinders, which pictures and scans have alike.

A row of (c, 6) is x, y, radius, bottom and top, m, and grey level.
"""

from collections.abc import Callable

import numpy as np

from ...core.se2 import Array

People = Callable[[float], Array]
"""Time, s -> the cylinders (c, 6) of all who are there."""

TROUSERS, JACKETS, SKIN = (45.0, 70.0, 95.0), (190.0, 110.0, 60.0, 150.0), 175.0  # grey levels
LEGS_TO, BODY, HEAD = 0.85, (0.19, 0.8, 1.5), (0.1, 1.52, 1.75)  # m; of these radius, bottom and top


NOBODY = np.zeros((0, 6))


def nobody(t: float) -> Array:
    """Nobody, at any time."""
    del t
    return NOBODY


def upright(legs: Array, who: Array) -> Array:
    """The cylinders of people by their legs, discs (2 m, 3) x, y and radius, m, two each, and numbers (m,)."""
    rows = list[list[float]]()
    for (left, right), number in zip(legs.reshape(-1, 2, 3), who.tolist(), strict=True):
        middle = ((left + right) / 2)[:2].tolist()
        rows += [[*leg.tolist(), 0.0, LEGS_TO, TROUSERS[number % len(TROUSERS)]] for leg in (left, right)]
        rows += [[*middle, *BODY, JACKETS[number % len(JACKETS)]], [*middle, *HEAD, SKIN]]
    return np.array(rows).reshape(-1, 6)


def standing_on_floor(people: Array) -> Array:
    """The discs (d, 3) of the cylinders that a scanner close to the floor sees: the legs."""
    return np.ascontiguousarray(people[people[:, 3] == 0.0, :3])
