"""The rendered room by a robot with an IMU: sightings, map and path are closer levelled than as the body rocks."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from drawn_errors import seen
from slamduel.backends import registry
from slamduel.core.factors import Dataset, Log, Truth
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.aruco_room import LEVELLED, PROPORTIONAL, Options, aruco_room, record
from slamduel.frontend.inertial.tilts import LEVELS, Tilts
from slamduel.frontend.markers.noise import Noise, PropagatedNoise
from slamduel.frontend.markers.noise_fit import squares
from slamduel.frontend.markers.pipeline import Recording, build_log
from tiers import first_quick

OPTIONS = Options(seconds=15.0, imu=True)
MODELS: dict[str, Noise] = {
    "propagated": PropagatedNoise(sway=OPTIONS.sway),
    "proportional": replace(LEVELLED, sway=OPTIONS.sway),
}


@cache
def drive(seed: int, seconds: float) -> tuple[Recording, Truth]:
    """A drive whose markers are detected once for all."""
    recording, truth = record(replace(OPTIONS, seconds=seconds), generator("aruco-room", seed))
    see = recording.detector.detect
    frames = [one._replace(image=None, found=see(one.image)) for one in recording.frames if one.image is not None]
    return replace(recording, frames=frames), truth


def off(log: Log, truth: Truth) -> Array:
    """(s, 2) errors of the range and bearing of every sighting."""
    assert truth.map is not None
    error = log.z - seen(truth.poses[log.sighting_step], truth.map.xy[np.searchsorted(truth.map.ids, log.ids)])
    error[:, 1] = wrap(error[:, 1])
    return error


class Score(NamedTuple):
    """Root mean squares."""

    range: float  # m
    bearing: float  # rad
    nees: float  # of sightings, per degree of freedom
    path: float  # m
    map: float  # m


def score(seed: int, model: str, seconds: float, *, levelled: bool) -> Score:
    recording, truth = drive(seed, seconds)
    tilts = recording.tilts if levelled else None
    log = build_log(replace(recording, noise=MODELS[model], tilts=tilts))
    errors = off(log, truth)
    build = registry.find("smoother")
    one = build.make(log.prior, build.options(), np.random.default_rng(0))
    for step in log:
        one.step(step)
    found = one.finish()
    assert found is not None
    assert truth.map is not None
    path = found.path[:, :2] - truth.poses[:, :2]
    places = found.map.xy - truth.map.xy[np.searchsorted(truth.map.ids, found.map.ids)]
    ranges, bearings = np.sqrt((errors**2).mean(axis=0)).tolist()
    nees = float(squares(errors, log.z_cov).mean() / 2)
    return Score(ranges, bearings, nees, *(float(np.sqrt((one**2).sum(axis=1).mean())) for one in (path, places)))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("seeds", "seconds"), first_quick([((1,), 3.0), (tuple(range(8)), 15.0)]))
def test_map_and_path_are_closer_by_gravity(seeds: Sequence[int], seconds: float, model: str) -> None:
    level, plain = (np.array([score(seed, model, seconds, levelled=one) for seed in seeds]) for one in (True, False))
    ratio = dict(zip(Score._fields, np.exp(np.log(level / plain).mean(axis=0)), strict=True))
    assert ratio["range"] < 0.6
    assert ratio["bearing"] < 0.5
    nees = Score(*level.mean(axis=0)).nees
    if len(seeds) > 1:
        assert 0.5 < nees < 2.0
        assert ratio["path"] < 0.85
        assert ratio["map"] < 0.8
        assert (level < plain).mean(axis=0)[-1] >= 0.75
    else:
        assert nees < 3.0


def test_the_world_is_levelled_and_says_so() -> None:
    options = replace(OPTIONS, seconds=2.0, frame_rate=2.0)
    level, truth = aruco_room(options, generator("aruco-room", 3))
    told = level.notes[LEVELS]
    assert 0.05 < told["sd"] < 0.6
    assert set(told) == {"sd", "rocking", "own_tilt", "push", "lasting"}
    recording, _ = record(options, generator("aruco-room", 3))
    assert isinstance(recording.tilts, Tilts)
    plain = build_log(replace(recording, tilts=None))
    assert LEVELS not in plain.notes
    assert truth is not None
    assert (off(level, truth) ** 2).sum() < (off(plain, truth) ** 2).sum()
    np.testing.assert_array_equal(level.delta[1:], plain.delta[1:])


def test_each_camera_is_levelled_through_its_own_mounting() -> None:
    """Two cameras see other markers of one rocking body: those of either are closer to their places."""
    options = replace(OPTIONS, seconds=3.0, frame_rate=3.0, cameras=2)
    recording, truth = record(options, generator("aruco-room", 4))
    frames = list(recording.frames)
    for name in ("front", "back"):
        mine = [one for one in frames if one.camera == name]
        level, plain = (build_log(replace(recording, frames=mine, tilts=tilts)) for tilts in (recording.tilts, None))
        assert len(level.ids) > 5
        assert ((off(level, truth) ** 2).sum(axis=0) < (off(plain, truth) ** 2).sum(axis=0) / 2).all()
    both = build_log(replace(recording, frames=frames))
    assert len(both) == options.frames


def test_without_an_imu_the_log_is_as_it_was() -> None:
    options = Options(seconds=1.0, frame_rate=2.0)
    recording, _ = record(options, generator("aruco-room", 5))
    assert recording.tilts is None
    made: Dataset = aruco_room(options, generator("aruco-room", 5))
    assert made.log.digest == build_log(record(options, generator("aruco-room", 5))[0]).digest
    noise = record(replace(options, noise="proportional"), generator("aruco-room", 5))[0].noise
    assert noise == PROPORTIONAL
