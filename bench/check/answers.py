"""Refuses answers of a backend that have another type or shape, or are not finite."""

import numpy as np

from ...backends.api import Map
from .candidate import Failed


def check_array(value: object, shape: tuple[int, ...], dtype: type, what: str) -> None:
    """Raises Failed unless `value` is a finite array of this shape and type."""
    if not isinstance(value, np.ndarray):
        raise Failed(f"{what} is a {type(value).__name__}, expected an array of shape {shape}")
    if value.shape != shape or value.dtype != dtype:
        raise Failed(f"{what} is {value.dtype} {value.shape}, expected {np.dtype(dtype)} {shape}")
    if not np.isfinite(value).all():
        raise Failed(f"{what} is not finite: {value.tolist()}")


def check_map(landmarks: object, what: str) -> None:
    """Raises Failed unless `landmarks` is a Map of finite arrays that has each landmark once."""
    if not isinstance(landmarks, Map):
        raise Failed(f"{what} is a {type(landmarks).__name__}, expected a Map")
    n = len(landmarks.ids)
    check_array(landmarks.ids, (n,), np.int64, f"{what}'s ids")
    check_array(landmarks.xy, (n, 2), np.float64, f"{what}'s xy")
    if len(np.unique(landmarks.ids)) < n:
        raise Failed(f"{what} has a landmark twice among ids {landmarks.ids.tolist()}, expected each once")
    if landmarks.cov is not None:
        check_array(landmarks.cov, (2 * n, 2 * n), np.float64, f"{what}'s covariance")
