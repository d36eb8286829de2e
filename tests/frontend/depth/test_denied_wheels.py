"""Wheels that the frames contradict: their motion is less certain, and what was seen before is found all the same."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from slamduel.core.factors import REMARKS, Log, Truth
from slamduel.core.se2 import Array, between, compose
from slamduel.datasets.truth import with_truth
from slamduel.datasets.worlds.depth_room import Drive, record
from slamduel.frontend.depth.log import build_log
from slamduel.frontend.depth.recording import DepthRecording
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.wheels.track import Track
from tiers import first_quick

LANDMARKS = Settings()
SIGHT = Settings(landmarks=False, loops=True, odometry="visual")


@cache
def recorded() -> tuple[DepthRecording, Truth]:
    """A short drive, its frames in memory."""
    recording, truth = record(Drive(laps=0.12), np.random.default_rng(3))
    return replace(recording, frames=list(recording.frames)), truth


def driven(jump: Array | None, settings: Settings) -> tuple[Log, Array]:
    """Its log where the odometry jumps once by a motion (3,); squared errors of its steps' motions over 3."""
    recording, truth = recorded()
    assert isinstance(recording.motion, Track)
    if jump is not None:
        poses, half = recording.motion.poses.copy(), len(recording.motion.t) // 2
        after = between(poses[half], poses[half:])
        poses[half:] = compose(compose(poses[half], jump), after)
        recording = replace(recording, motion=replace(recording.motion, poses=poses, max_speed=np.inf))
    log, known = with_truth(build_log(recording, settings), truth)
    assert known is not None
    off = between(between(known.poses[:-1], known.poses[1:]), log.delta[1:])
    return log, np.einsum("ni,nij,nj->n", off, np.linalg.inv(log.delta_cov[1:]), off) / 3


def test_wheels_that_do_not_jump_are_not_contradicted() -> None:
    log, nees = driven(None, LANDMARKS)
    assert REMARKS not in log.notes
    assert nees.mean() < 4


@pytest.mark.parametrize("turn", first_quick((0.5, -0.5)))
def test_a_jump_of_the_wheels_is_no_jump_of_the_robot(turn: float) -> None:
    log, nees = driven(np.array([0.0, 0.0, turn]), LANDMARKS)
    assert nees.mean() < 4
    (remark,) = log.notes[REMARKS]
    assert "the frames contradict the odometry" in remark
    # landmarks are followed through the jump
    middle = log.t.searchsorted(log.t[0] + (log.t[-1] - log.t[0]) / 2)
    before, after = (set(log.ids[part].tolist()) for part in (log.sighting_step < middle, log.sighting_step > middle))
    assert len(before & after) > 10


def test_by_sight_wheels_that_jump_change_little() -> None:
    for jump in (None, np.array([0.0, 0.0, 0.5])):
        _, nees = driven(jump, SIGHT)
        assert nees.mean() < 4
