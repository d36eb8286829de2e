"""Draws the front end's findings on a frame of a depth camera."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from ...core.se2 import Array, Ints
from ...frontend.camera.camera import Camera
from ...frontend.depth.front_end import FrameFindings
from ...frontend.depth.level import tilt_of
from ...frontend.depth.pairs import Keyframe, Trial
from ...frontend.markers.aruco import Image
from .pictures import KEPT, REFUSED, write

CONTRADICTED, ALONE, HORIZON = (167, 121, 204), (160, 160, 160), (233, 180, 86)
"""BGR, beside those that all sensors have."""

LEGEND = (
    (KEPT, "agrees with the motion"),
    (REFUSED, "matched, but disagrees"),
    (CONTRADICTED, "moves, or agrees with a refused motion"),
    (ALONE, "no match"),
    (HORIZON, "horizon by the floor"),
)

LINES = 60  # motions of features since the step before that are drawn, at most
NAMED = 25  # landmarks whose ids are drawn, at most
APART = 40.0  # px at 640 pixels of width between two ids


def annotated(seen: FrameFindings, camera: Camera) -> Image:
    """Draws features by what became of them, landmarks' ids, the levelled horizon, and the motions tried."""
    frame, keyframe = seen.frame, seen.keyframe
    picture = np.array(cv2.cvtColor(frame.grey, cv2.COLOR_GRAY2BGR) if frame.colour is None else frame.colour)
    size = picture.shape[1] / 640
    if keyframe is not None:
        _horizon(picture, keyframe, camera)
        _features(picture, seen, keyframe, size)
    _legend(picture, size)
    for row, line in enumerate(reversed(_lines(seen, camera))):
        write(picture, line, (round(6 * size), picture.shape[0] - round((8 + 17 * row) * size)), 0.45 * size)
    return np.asarray(picture, np.uint8)


def _lines(seen: FrameFindings, camera: Camera) -> list[str]:
    """Says in words: the time and step, the level, and the motions tried."""
    t, keyframe = f"{seen.frame.seconds:.2f} s", seen.keyframe
    if keyframe is None:
        return [f"{t}  not looked at: less than a step, or no odometry"]
    tilt = tilt_of(keyframe.level, camera)
    level = "no floor found: as mounted"
    if keyframe.level.found:
        pitch, roll = np.degrees(tilt.pitch), np.degrees(tilt.roll)
        level = f"floor: pitch {pitch:+z.1f}, roll {roll:+z.1f} deg, height {1000 * tilt.up:+z.0f} mm"
    said = [f"{t}  " + (f"step {keyframe.step}" if seen.stepped else "no step yet"), level]
    said += [f"with step {one.first.step}: {_outcome(one)}" for one in seen.trials]
    again = [one for one in seen.loops if one.pair is not None]
    if again:
        best = max(again, key=lambda one: len(one.matches))
        said.append(f"seen before, at step {best.first.step}: {_outcome(best)}")
    return said


def _outcome(trial: Trial) -> str:
    if trial.pair is None:
        return f"refused, {trial.reason}"
    return f"{len(trial.pair.rows)} of {len(trial.matches)} matches agree"


def _features(picture: Any, seen: FrameFindings, keyframe: Keyframe, size: float) -> None:
    """Draws every feature, and a line to where one that agrees was in the step before."""
    pixels, n = keyframe.features.pixels, len(keyframe.features)
    trials = [*seen.trials, *seen.loops]
    matched = _rows([one.matches for one in trials], n)
    contradicted = _rows([one.contradicted for one in trials], n)
    kept = _rows([one.pair.rows for one in trials if one.pair is not None], n)
    for pair in [one.pair for one in seen.trials[:1] if one.pair is not None]:
        for before, now in pair.rows[:: -(-len(pair.rows) // LINES)].tolist():
            ends = (_at(pair.first.features.pixels[before]), _at(pixels[now]))
            cv2.line(picture, *ends, KEPT, 1, cv2.LINE_AA)
    for row in range(n):
        colour = KEPT if kept[row] else CONTRADICTED if contradicted[row] else REFUSED if matched[row] else ALONE
        radius = max(1, round((1.2 if colour == ALONE else 2.6) * size))
        cv2.circle(picture, _at(pixels[row]), radius, colour, cv2.FILLED, cv2.LINE_AA)
    _ids(picture, keyframe, size)


def _rows(pairs: Sequence[Ints], n: int) -> Any:
    """(n,) True for the features of the second frame in some of the pairs (m, 2)."""
    out = np.zeros(n, np.bool_)
    for rows in pairs:
        out[rows[:, 1]] = True
    return out


def _ids(picture: Any, keyframe: Keyframe, size: float) -> None:
    """Writes the ids of landmarks that are far enough from one another."""
    taken = list[Array]()
    for row in np.flatnonzero(keyframe.ids >= 0):
        at = keyframe.features.pixels[row]
        if len(taken) < NAMED and all(np.hypot(*(at - other)) > APART * size for other in taken):
            taken.append(at)
            x, y = _at(at)
            write(picture, str(keyframe.ids[row]), (x + round(4 * size), y - round(4 * size)), 0.3 * size)


def _horizon(picture: Any, keyframe: Keyframe, camera: Camera) -> None:
    """Draws the horizon as the level has it."""
    bearing = np.linspace(-1.2, 1.2, 49)
    rays = np.column_stack((np.cos(bearing), np.sin(bearing), np.zeros(len(bearing)))) @ keyframe.level.T[:3, :3]
    rays = rays[rays[:, 2] > 0.1]
    rays = rays[np.hypot(*(rays[:, :2] / rays[:, 2:]).T) < camera.reach]
    if len(rays) > 1:
        line = np.rint(camera.project(rays)).astype(np.int32)
        cv2.polylines(picture, [line], False, HORIZON, 1, cv2.LINE_AA)


def _legend(picture: Any, size: float) -> None:
    for row, (colour, words) in enumerate(LEGEND):
        x, y = round(8 * size), round((12 + 15 * row) * size)
        write(picture, words, (x + round(12 * size), y + round(4 * size)), 0.35 * size)
        cv2.circle(picture, (x, y), max(2, round(3 * size)), colour, cv2.FILLED, cv2.LINE_AA)


def _at(pixel: Array) -> tuple[int, int]:
    return round(float(pixel[0])), round(float(pixel[1]))
