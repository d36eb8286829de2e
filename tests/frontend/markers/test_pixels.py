"""Which pixels of a frame a pattern's fit looks at."""

import numpy as np
import pytest
from numpy.typing import NDArray

from slamduel.core.se2 import Array
from slamduel.frontend.markers._pixels import MARGIN, REACH, gather

M, PITCH, SIDE = 6, 40.0, 320
"""Modules of the pattern, px of one, and px of the frame around it."""


def gathered(blur: float, most: int) -> Array:
    """(n, 2) columns and rows of the pixels that are looked at, under a `blur`, px."""
    v, u = np.mgrid[:SIDE, :SIDE].astype(float)
    G = np.diag([1 / PITCH, 1 / PITCH, 1.0])
    G[:2, 2] = -1.0
    look = np.zeros(13)
    look[2] = look[4] = np.log(blur)
    places = np.empty((SIDE * SIDE, 8))
    grey = np.zeros((SIDE, SIDE), np.uint8)
    count = gather(grey, np.stack((u, v), axis=-1), G, look, M, (0, SIDE, 0, SIDE), most, places)
    odd = places[:count, 1:3].astype(int) % 2
    np.testing.assert_array_equal(places[:count, 7], odd @ [1, 2])
    return places[:count, 1:3]


def there(blur: float) -> NDArray[np.bool_]:
    """(SIDE, SIDE) whether a pixel is in the pattern and near an edge."""
    along = np.arange(SIDE) / PITCH - 1
    near = np.abs(along - np.clip(np.round(along), 0, M)) < REACH * blur / PITCH
    within = (along > -MARGIN) & (along < M + MARGIN)
    return (near[:, None] | near) & within[:, None] & within


def test_where_they_are_few_all_pixels_near_edges_are_taken() -> None:
    found = np.zeros((SIDE, SIDE), bool)
    columns, rows = gathered(0.7, 10**6).astype(int).T
    found[rows, columns] = True
    np.testing.assert_array_equal(found, there(0.7))
    assert len(rows) == found.sum()


@pytest.mark.parametrize("along", [(6, -1), (3, -4), (4, 1), (3, 1), (1, 1), (0, 1), (2, 0), (0, 2)])
def test_a_sample_does_not_repeat_along_an_edge(along: tuple[int, int]) -> None:
    """Roberts' R2 sequence does along (6, -1) and (3, -4): nearly all next pixels there are taken, or none."""
    most = 12000
    columns, rows = gathered(7.0, most).astype(int).T
    assert len({*zip(columns, rows, strict=True)}) == len(rows)
    assert there(7.0)[rows, columns].all()
    assert 0.8 * most < len(rows) < 1.2 * most
    # near the middle of a wide blur all are in the pattern
    taken = np.zeros((SIDE, SIDE))
    taken[rows, columns] = 1
    inner = taken[30:290, 30:290]
    other = taken[30 + along[1] : 290 + along[1], 30 + along[0] : 290 + along[0]]
    correlation = np.corrcoef(inner.ravel(), other.ravel())[0, 1]
    # of 260^2 pixels; along a row, parts of 1 / share px that have one pixel each repel
    assert abs(correlation) < 0.03 or along[1] == 0
    assert correlation < 0.1
