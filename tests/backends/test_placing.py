"""The place of a landmark by its partial sightings, from precise ones to rough ones."""

import numpy as np
import pytest

from slamduel.backends.starting.placing import placed
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import Array, wrap


def seen(poses: Array, xy: Array, kind: int, sd: float, rng: np.random.Generator) -> Array:
    """Measurements (k,) of one kind from poses (k, 3)."""
    d = xy - poses[:, :2]
    exact = np.hypot(*d.T) if kind == RANGE else wrap(np.arctan2(d[:, 1], d[:, 0]) - poses[:, 2])
    return exact + sd * rng.standard_normal(len(poses))


@pytest.mark.parametrize("sd", [1e-4, 1e-3, 1e-2, 0.05])
def test_two_ranges_leave_two_places(sd: float) -> None:
    """Mirrored ones, with the same loss, wherever the landmark is; down to a tenth of a millimetre."""
    rng = np.random.default_rng(1)
    poses = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.2]])
    for _ in range(50):
        xy = rng.uniform(-8, 8, 2)
        place = placed(poses, np.full(2, RANGE), seen(poses, xy, RANGE, sd, rng), np.full(2, sd**2))
        assert place is None or not place.sure


@pytest.mark.parametrize("kind", [RANGE, BEARING])
@pytest.mark.parametrize("sd", [1e-5, 1e-4, 1e-3, 1e-2])
def test_sightings_along_an_arc_place_it(kind: int, sd: float) -> None:
    """Within five of the standard deviations that are stated, and surely, of 50 places around."""
    rng = np.random.default_rng(2)
    angle = np.linspace(0, 2, 12)
    poses = np.column_stack((3 * np.sin(angle), 3 - 3 * np.cos(angle), angle))
    kinds, var = np.full(12, kind), np.full(12, sd**2)
    for _ in range(50):
        xy = rng.uniform(-8, 8, 2)
        place = placed(poses, kinds, seen(poses, xy, kind, sd, rng), var)
        assert place is not None
        assert place.sure
        off = place.xy - xy
        assert off @ np.linalg.solve(place.cov, off) < 5**2
