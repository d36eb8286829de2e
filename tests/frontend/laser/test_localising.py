"""Localisation on a grid: a drive is found on the grid of its own scans, and one that is not on it is a sentence."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from floor_drives import floor_drive
from slamduel.frontend.errors import InputError
from slamduel.frontend.factors import Log
from slamduel.frontend.laser.log import build_log
from slamduel.frontend.laser.occupancy import Occupancy, occupancy
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.se2 import Array, compose


@cache
def mapped() -> tuple[Log, Array, Occupancy]:
    """The log of a drive, its dead-reckoned path, and the grid along that."""
    log = build_log(floor_drive(), Settings())
    path = [log.prior.pose]
    for delta in log.delta[1:]:
        path.append(compose(path[-1], delta))
    assert log.scans is not None
    return log, np.array(path), occupancy(log.scans, np.array(path))


def test_every_step_is_where_it_was_when_the_grid_was_made() -> None:
    _, path, grid = mapped()
    log = build_log(replace(floor_drive(), map=grid), Settings())
    assert len(log) == len(path) + 1  # step 0 is the map's frame
    assert len(log.loop_to) > 0.9 * len(path)
    assert set(log.loop_to.tolist()) == {0}
    steps = np.repeat(np.arange(len(log)), np.diff(log.loop_first))
    found = compose(np.broadcast_to(log.prior.pose, log.loop_delta.shape), log.loop_delta)
    assert np.hypot(*(found - path[steps - 1])[:, :2].T).max() < grid.size


def test_a_start_far_off_the_grid_is_a_sentence() -> None:
    drive, grid = floor_drive(), mapped()[2]
    far = drive.prior._replace(pose=drive.prior.pose + np.array((500.0, -20.0, 0.0)))
    with pytest.raises(InputError, match=r"none of its \d+ steps matches the grid, from a start at x 50\d m, y -\d+"):
        build_log(replace(drive, map=grid, prior=far), Settings())
