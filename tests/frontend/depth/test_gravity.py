"""Depth frames without a floor, levelled by gravity: closer, and as sure as they are."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from slamduel.core.se2 import between, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.depth_room import Options, depth_room, record, shots_of
from slamduel.frontend.depth.front_end import BY_GRAVITY, FrontEnd
from slamduel.frontend.depth.level import Leveller, tilt_of
from slamduel.frontend.depth.log import looked_at
from slamduel.frontend.depth.recording import DepthRecording
from slamduel.frontend.wheels.track import Track
from tiers import first_quick

OPTIONS = Options(laps=0.3, frame_rate=2.0, imu=True, level=False, landmarks=False, loops=True)
SEEDS = range(8)


@cache
def drive(seed: int) -> DepthRecording:
    """A rocking drive in memory."""
    recording, _ = record(OPTIONS, generator("depth-room", seed))
    return replace(recording, frames=list(recording.frames))


def squares(found: FrontEnd, seed: int) -> float:
    """The mean normalised squared error of motions and loops; 1 where covariances are right."""
    _, truth = record(OPTIONS, generator("depth-room", seed))
    poses = truth.poses[np.searchsorted(truth.t, [step.t for step in found.steps])]
    out = list[float]()
    for one in [*found.told, *found.loops]:
        off = one.motion.delta - between(poses[one.to], poses[one.step])
        off[2] = wrap(off[2])
        out.append(float(off @ np.linalg.solve(one.motion.cov, off)) / 3)
    assert len(out) > 10
    return float(np.mean(out))


@pytest.mark.parametrize("seed", first_quick(SEEDS, 1))
def test_levels_by_gravity_make_motions_as_sure_as_stated(seed: int) -> None:
    levelled, plain = looked_at(drive(seed), OPTIONS), looked_at(replace(drive(seed), tilts=None), OPTIONS)
    assert levelled.counts[BY_GRAVITY] == levelled.counts["frames looked at"]
    assert not plain.counts[BY_GRAVITY]
    assert squares(levelled, seed) < 2.5
    assert squares(levelled, seed) < squares(plain, seed)


@pytest.mark.parametrize("seed", first_quick(SEEDS, 1))
def test_levels_are_those_of_the_body(seed: int) -> None:
    recording, _ = record(OPTIONS, generator("depth-room", seed))
    shots = shots_of(recording)
    leveller, nothing = Leveller(recording.camera, OPTIONS, recording.tilts), np.zeros((4, 4), np.float32)
    levels = [leveller.level(nothing, one) for one in shots.t.tolist()]
    assert all(one.by_gravity and not one.found for one in levels)
    off = np.array([tilt_of(one, recording.camera)[:2] for one in levels]) - shots.tilts
    sd = np.sqrt([np.diag(one.cov)[[1, 0]] for one in levels])
    assert np.sqrt((off**2).mean()) < 0.5 * np.sqrt((shots.tilts**2).mean())
    assert ((off / sd) ** 2).mean() < 2.0
    before = leveller.level(nothing, -10.0)
    np.testing.assert_array_equal(before.T, recording.camera.mounting)


def test_a_floor_counts_where_there_is_one() -> None:
    own = drive(0)
    found = looked_at(own, replace(OPTIONS, level=True))
    assert not found.counts[BY_GRAVITY]
    again = looked_at(replace(own, tilts=None), replace(OPTIONS, level=True))
    for mine, other in zip(found.told, again.told, strict=True):
        np.testing.assert_array_equal(mine.motion.delta, other.motion.delta)
        np.testing.assert_array_equal(mine.motion.cov, other.motion.cov)


def test_a_world_without_an_imu_is_what_it_was() -> None:
    alone, _ = record(replace(OPTIONS, imu=False), generator("depth-room", 1))
    felt, _ = record(OPTIONS, generator("depth-room", 1))
    assert alone.tilts is None
    assert isinstance(alone.motion, Track)
    assert isinstance(felt.motion, Track)
    np.testing.assert_array_equal(alone.motion.poses, felt.motion.poses)
    log = depth_room(replace(OPTIONS, laps=0.1), generator("depth-room", 1)).log
    assert log.notes["levels"]["sd"] < 0.6
