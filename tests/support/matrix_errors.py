"""Errors of motions by homogeneous matrices, one after another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from slamduel.core.se2 import Array


def matrix(pose: Any) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def judges_as_matrices_do(row: Any, motions: Sequence[Any]) -> None:
    """A front end's row has the errors and NEES of these motions: true frames before and after, delta, covariance."""
    squares, errors = list[float](), list[Array]()
    for before, after, delta, cov in motions:
        true = np.linalg.inv(before) @ after
        turn = np.arctan2(true[1, 0], true[0, 0])
        off = np.array([*(delta[:2] - true[:2, 2]), np.angle(np.exp(1j * (delta[2] - turn)))])
        squares.append(float(off @ np.linalg.inv(cov) @ off))
        errors.append(off**2)
    assert row.factors == len(motions) > 0
    assert row.nees == pytest.approx(np.mean(squares) / 3, rel=1e-6)
    assert row.true == pytest.approx(np.sqrt(np.mean(errors, axis=0)).tolist(), rel=1e-6)
