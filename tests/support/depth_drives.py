"""Drives through the rendered room with a depth camera, their frames in memory."""

from dataclasses import replace
from functools import cache

import numpy as np

from slamduel.core.factors import Truth
from slamduel.datasets.rendering.depth_shots import DepthShots
from slamduel.datasets.worlds.depth_room import Drive, record
from slamduel.frontend.depth.features import Finder
from slamduel.frontend.depth.level import Leveller
from slamduel.frontend.depth.pairs import Keyframe, without_ids
from slamduel.frontend.depth.recording import DepthFrame, DepthRecording
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.depth.surfaces import Surfaces


@cache
def drive(seed: int, options: Drive, count: int) -> tuple[DepthRecording, list[DepthFrame], Truth]:
    """The first `count` frames of a drive, rendered once, as its recording and as a list, and their true poses."""
    recording, truth = record(options, np.random.default_rng(seed))
    shots = recording.frames
    assert isinstance(shots, DepthShots)
    frames = [shots.shot(k) for k in range(min(count, len(shots)))]
    return replace(recording, frames=frames), frames, Truth(truth.t[: len(frames)], truth.poses[: len(frames)])


def keyframe(step: int, frame: DepthFrame, recording: DepthRecording, settings: Settings) -> Keyframe:
    """A frame as the front end keeps it."""
    camera = recording.camera
    features = Finder(camera, settings).find(frame.grey, frame.depth)
    level = Leveller(camera, settings).level(frame.depth)
    coarse = Surfaces(camera, settings).coarse(frame.depth)
    return Keyframe(step, frame.seconds, features, level, coarse, without_ids(features))
