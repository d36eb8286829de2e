"""Disturbances that vary between frames: rocking, motion blur, brightness, shadows, occlusion."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...core.se2 import Array
from ...frontend.markers.pipeline import Frame
from ..on_demand.rocking import Rocking
from ._casting import cast
from .lens import Singles
from .people import People, nobody
from .render import Conditions, Cover, Renderer
from .room import NO_DISCS

GRID = 40  # px between the pixels whose streaks are measured
STILL = 0.02  # px; shorter streaks are ignored
FLAT = 1e-9  # of a ray, along the floor, at least
SPREAD = 3.0  # px, standard deviation of the blur of an occluder's edge: it is too near to be sharp
DUSK = 45.0  # px, over which half of a shadow's edge falls
BEATS = np.array([3.1, 5.3, 8.9, 15.7])  # s, periods of the brightness drift's components


@dataclass(frozen=True)
class Disturbances:
    """Differences between frames and those of a still camera in even light."""

    sway: float = 0.0  # rad, standard deviation of the body's pitch and of its roll
    gain_drift: float = 0.0  # standard deviation over time of the logarithm of the brightness
    shadow: float = 0.0  # share of the light that the darker side of each frame lacks
    occlusion: float = 0.0  # share of the frames in which the view is partly covered


def take(
    renderers: Sequence[Renderer],
    path: Callable[[Array], Array],
    t: Array,
    disturbances: Disturbances,
    rng: np.random.Generator,
    rocking: Rocking | None = None,
    people: People = nobody,
) -> Iterator[Frame]:
    """Yields the frames at `t` (n,), s, the middles of their exposures, of each of the cameras on a robot in turn.

    `path` gives the robot's poses (m, 3) at any times (m,). The body rocks as `rocking` says, else by the sway of the
    `disturbances`, anew in every frame, during which it then keeps still. The same seed gives the same grain, shadows
    and occluders whatever the other settings, and the first camera the same frames whatever the others are.
    """
    sensor, light, covers, floor = rng.spawn(4)
    streams = [(sensor, light, covers), *(tuple(rng.spawn(3)) for _ in renderers[1:])]
    phases = [of.uniform(0, 2 * np.pi, len(BEATS)) for _, of, _ in streams]
    for time, pose in zip(t.tolist(), raised(path(t)), strict=True):
        body = rocked(*floor.normal(0, 1, 2) * disturbances.sway)
        if rocking is not None:
            body = rocked(*rocking.at(np.array([time]))[0])
        for renderer, (grain, shading, covering), phase in zip(renderers, streams, phases, strict=True):
            mounting = body @ renderer.camera.mounting
            shade = _shadow(renderer, disturbances.shadow, shading)
            cover = _cover(renderer, disturbances.occlusion, covering)
            swing = np.sqrt(2 / len(BEATS)) * np.sin(2 * np.pi * time / BEATS + phase).sum()
            light = shade * np.float32(np.exp(disturbances.gain_drift * swing))
            conditions = Conditions(light, cover, people(time))
            moving = renderer.sensor.exposure or renderer.sensor.readout
            if not moving:
                poses = pose @ mounting
            elif rocking is None:
                poses = views(renderer, path, time, mounting)
            else:
                poses = views(renderer, path, time, renderer.camera.mounting, rocking)
            yield Frame(time, renderer.frame(poses, grain, conditions), camera=renderer.camera.name)


def tilts_in(t: Array, disturbances: Disturbances, rng: np.random.Generator, rocking: Rocking | None = None) -> Array:
    """(n, 2) rad, pitch and roll of the body in the frames that `take` yields at `t` (n,), s, with the same `rng`."""
    if rocking is not None:
        return rocking.at(t)
    *_, floor = rng.spawn(4)  # as `take` does
    return disturbances.sway * floor.normal(0, 1, (len(t), 2))


def views(
    renderer: Renderer, path: Callable[[Array], Array], t: float, mounting: Array, rocking: Rocking | None = None
) -> Array:
    """(n, 4, 4) T_world_camera at the middles of n equal parts of the exposure around `t`, s.

    With a rolling shutter they are (b, n, 4, 4), of each of its bands of rows. `mounting` (4, 4) is that of the camera
    on the level robot, or on one that rocks as `rocking` says. There is one more than pixels in the longest streak of
    anything in view, so that streaks are ramps and not steps.
    """
    exposure = renderer.sensor.exposure

    def seen_from(at: Array) -> Array:
        robot = raised(path(at))
        return (robot if rocking is None else robot @ np.array([rocked(*one) for one in rocking.at(at)])) @ mounting

    start, end = (seen_from(np.array([t + part])) for part in (-exposure / 2, exposure / 2))
    streak = _streak(renderer, start[0], end[0])
    parts = int(np.ceil(streak)) + 1 if streak > STILL else 1
    times = t + exposure * ((np.arange(parts) + 0.5) / parts - 0.5)
    if not renderer.sensor.readout:
        return seen_from(times)
    rows = renderer.sensor.delays(renderer.camera.height)
    return np.array([seen_from(later + times) for later in rows])


def raised(poses: Array) -> Array:
    """Converts planar poses (n, 3) to (n, 4, 4) T_world_robot."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    full = np.zeros((len(poses), 4, 4))
    full[:, 0, 0] = full[:, 1, 1] = c
    full[:, 1, 0], full[:, 0, 1] = s, -s
    full[:, :2, 3] = poses[:, :2]
    full[:, 2, 2] = full[:, 3, 3] = 1
    return full


def rocked(pitch: float, roll: float) -> Array:
    """(4, 4) T_level_robot of a body pitched by `pitch` forward and rolled by `roll` to the right, rad."""
    (cp, sp), (cr, sr) = (np.cos(pitch), np.sin(pitch)), (np.cos(roll), np.sin(roll))
    return np.array([[cp, sp * sr, sp * cr, 0], [0, cr, -sr, 0], [-sp, cp * sr, cp * cr, 0], [0, 0, 0, 1]])


def _streak(renderer: Renderer, start: Array, end: Array) -> float:
    """px, the largest motion in the image of anything visible from two poses (4, 4) T_world_camera."""
    lens, room = renderer.lens, renderer.room
    rays = lens.rays[:, ::GRID, ::GRID].reshape(3, -1).T[lens.open[::GRID, ::GRID].ravel()]
    ahead = rays.astype(float) @ start[:3, :3].T
    flat = np.maximum(np.hypot(*ahead[:, :2].T), FLAT)
    x, y, height = start[:3, 3].tolist()
    with np.errstate(divide="ignore", invalid="ignore"):
        if room.walls is None:
            walls = np.array([room.length / 2, room.width / 2])
            reach = ((np.copysign(walls, ahead[:, :2]) - start[:2, 3]) / ahead[:, :2]).min(axis=1)
        else:
            reach = cast(room.outlines, NO_DISCS, x, y, ahead[:, :2] / flat[:, None], room.perimeter) / flat
        to_floor = np.where(ahead[:, 2] < 0, -height / ahead[:, 2], np.inf)
    points = start[:3, 3] + np.minimum(reach, to_floor)[:, None] * ahead
    corners = [face.outline for box in room.boxes for face in box.faces]
    points = np.vstack((points, *(marker.pose[:3, 3] for marker in room.markers), *corners))
    seen = [(points - pose[:3, 3]) @ pose[:3, :3] for pose in (start, end)]
    # Beyond its reach a lens model turns back, and would project invisible points into the image.
    known = [np.hypot(*of[:, :2].T) < renderer.camera.reach * of[:, 2] for of in seen]
    front = (seen[0][:, 2] > 0.05) & (seen[1][:, 2] > 0.05) & known[0] & known[1]
    before, after = (renderer.camera.project(of[front]) for of in seen)
    size = np.array([renderer.camera.width, renderer.camera.height])
    inside = ((before >= 0) & (before < size)).all(axis=1)
    return float(np.linalg.norm(after - before, axis=1)[inside].max(initial=0.0))


def _shadow(renderer: Renderer, depth: float, rng: np.random.Generator) -> Singles:
    """(height, width) or a scalar: the light beside a soft edge at a random place."""
    angle, place = rng.uniform(-np.pi, np.pi), rng.uniform(0.15, 0.85, 2)
    if not depth:
        return np.ones((), np.float32)
    height, width = renderer.camera.height, renderer.camera.width
    v, u = np.ogrid[:height, :width]
    beyond = np.cos(angle) * (u - place[0] * width) + np.sin(angle) * (v - place[1] * height)
    return (1 - depth / (1 + np.exp(-beyond / DUSK))).astype(np.float32)


def _cover(renderer: Renderer, share: float, rng: np.random.Generator) -> Cover | None:
    """In a `share` of the frames a blurred polygon, dark or grey: a pole across the view or a hand at its edge."""
    chance, pole = rng.uniform(size=2)
    grey, angle, breadth = rng.uniform([12, -np.pi, 0.08], [120, np.pi, 0.22])
    middle, bumps = rng.uniform(0.2, 0.8, 2), rng.uniform(0.55, 1.0, 9)
    if chance >= share:
        return None
    height, width = renderer.camera.height, renderer.camera.width
    if pole < 0.5:
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        reach, half = 2.0 * width * along, breadth / 2 * width * across
        outline = middle * [width, height] + np.array([-reach - half, reach - half, reach + half, -reach + half])
    else:
        around = angle + 2 * np.pi * np.arange(len(bumps)) / len(bumps)
        rim = np.array([width, height]) * (0.5 + 0.55 * np.array([np.cos(angle), np.sin(angle)]))
        outline = rim + 2.4 * breadth * width * bumps[:, None] * np.stack((np.cos(around), np.sin(around)), axis=-1)
    mask = np.zeros((height, width), np.float32)
    cv2.fillPoly(mask, [np.round(outline).astype(np.int32)], 1.0)
    return Cover(np.asarray(cv2.GaussianBlur(mask, (0, 0), SPREAD), np.float32), float(grey))
