"""Clouds on their way to a log, which are in files meanwhile."""

import pickle

import numpy as np
import pytest

import depth_clouds as room
from slamduel.frontend.maps.cloud import NOTHING, Cloud
from slamduel.frontend.maps.spool import Spool


def some(*counts: int) -> list[Cloud]:
    rng = np.random.default_rng(1)
    return [Cloud(rng.normal(0, 3, (n, 3)), rng.integers(0, 256, (n, 3)).astype(np.uint8), np.ones(n)) for n in counts]


def test_clouds_are_kept_to_half_a_unit() -> None:
    parts = some(20, 0, 5)
    beside = room.spooled(parts)
    for k, part in enumerate(parts):
        np.testing.assert_allclose(beside.xyz(k), part.points, atol=0.0025 + 1e-9)
        np.testing.assert_array_equal(beside.rgb(k), part.colours)
    np.testing.assert_array_equal(beside.camera, room.CAMERA.mounting[:3, 3])
    path = np.array([[1.0, 2.0, 0.3], [0.0, 0.0, 0.0], [3.0, 1.0, -2.0]])
    np.testing.assert_array_equal(beside.at.along(path), path)


def test_clouds_outlive_their_spool_and_go_to_other_processes() -> None:
    beside = room.spooled(some(7, 9))  # the spool is gone
    again = pickle.loads(pickle.dumps(beside))
    assert type(again.points) is type(beside.points) is np.ndarray
    for one, other in zip(beside[1:], again[1:], strict=True):
        np.testing.assert_array_equal(one, other)


def test_more_clouds_may_follow_those_that_were_looked_at() -> None:
    first, second = some(4, 6)
    spool = Spool()
    spool.add(first)
    before = spool.clouds(room.CAMERA)
    spool.add(second)
    after = spool.clouds(room.CAMERA)
    assert (before.first[-1], after.first[-1]) == (4, 10)
    np.testing.assert_array_equal(before.points, after.points[:4])


@pytest.mark.parametrize("parts", [[], [NOTHING, NOTHING]])
def test_clouds_without_points_are_none(parts: list[Cloud]) -> None:
    beside = room.spooled(parts)
    assert beside.points.shape == beside.colours.shape == (0, 3)
    assert len(beside.first) == len(parts) + 1
