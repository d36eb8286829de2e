"""Derivatives by central differences."""

from collections.abc import Callable

import numpy as np

from slamduel.core.se2 import Array


def central(function: Callable[[Array], Array], at: Array, h: float = 1e-6) -> Array:
    """(..., n) d function / d at (n,); a truncation error of h^2 and a rounding error of eps / h are left."""
    return np.stack([(function(at + step) - function(at - step)) / (2 * h) for step in h * np.eye(len(at))], axis=-1)
