"""Wheels that the frames contradict: their motion is less certain, and what was seen before is found all the same."""

from dataclasses import replace

import numpy as np
import pytest

from slamduel.core.factors import REMARKS, Log
from slamduel.core.se2 import Array, between, compose
from slamduel.datasets.truth import with_truth
from slamduel.datasets.worlds.depth_room import Drive, record
from slamduel.frontend.depth.log import build_log
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.wheels.track import Track

LANDMARKS = Settings()
SIGHT = Settings(landmarks=False, loops=True, odometry="visual")


def driven(jump: Array | None, settings: Settings) -> tuple[Log, Array]:
    """A short drive whose odometry jumps once by a motion (3,); squared errors of its steps' motions over 3."""
    recording, truth = record(Drive(laps=0.12), np.random.default_rng(3))
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


@pytest.mark.parametrize("jump", [(0.0, 0.0, 0.5), (0.0, 0.0, -0.5)], ids=["left", "right"])
def test_a_jump_of_the_wheels_is_no_jump_of_the_robot(jump: tuple[float, ...]) -> None:
    clean, nees = driven(None, LANDMARKS)
    assert REMARKS not in clean.notes
    assert nees.mean() < 4
    log, nees = driven(np.array(jump), LANDMARKS)
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
