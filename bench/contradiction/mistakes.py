"""The usual mistakes of those who write a log: each with its sentence, and the change that takes it back.

A change is of a stretch of a log. Its motions are the differences of the poses that the robot's program wrote, each in
the frame of the pose before, or its speeds times the time; a mistake in poses or speeds is thus one in every motion.
Some changes have a number that nobody knows, such as a delay: several are tried, and the best one is refined.
"""

from collections.abc import Callable
from dataclasses import replace
from math import log as ln
from math import pi, tau
from typing import NamedTuple

import numpy as np

from ...core.factors import Log
from ...core.se2 import Array, between, wrap
from .motions import with_motions

DIRECTIONS = tuple((np.arange(-4, 4) * pi / 4).tolist())
"""rad; from an axis of the world to the one that it was taken for."""

DELAYS = (-2.0, -1.0, -0.5, -0.25, -0.1, -0.05, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
"""s."""

BASES = (0.08, 0.12, 0.16, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8)
"""m between the wheels of a robot."""

EITHER = tuple(-base for base in reversed(BASES)) + BASES

FACTORS = {1000.0: "millimetres", 100.0: "centimetres", 3.6: "km/h", 1 / 0.3048: "feet", 1 / 0.0254: "inches"}

DEGREE = pi / 180
NEVER = 1e-6
"""rad; headings that change by less never do."""

FEWEST, MOST, EXACT, WIDEST = 10, 0.9, 1e-3, 1.0
"""Motions on one circle: their number and share, how exactly, and its radius in m, half the base of a robot."""


class Mistake(NamedTuple):
    """A usual mistake; two that leave the same log are one."""

    name: str
    words: str  # "J falls to 1.1 if ...", with {} for the number
    undone: Callable[[Log, float], Log | None]  # the log without the mistake, by its number; None: it is not there
    numbers: tuple[float, ...] = (0.0,)  # that are tried
    between: bool = False  # the number may be any between those
    wrapped: bool = False  # large turns were added up and wrapped, so that not all can be taken back
    squeeze: Callable[[Log, float], float] = lambda *_: 0.0
    """By how much the logarithm of the space of the measurements shrinks: all agree if they are near 0."""


def _mirrored(log: Log, _: float) -> Log:
    """With motions to the other side: the mirror image of the log with bearings to the other side."""
    return with_motions(log, log.delta[1:, :2] * [1.0, -1.0], -log.delta[1:, 2])


def _turned(log: Log, degrees: float) -> Log:
    """With motions turned to the left: the log of a sensor that is turned to the right."""
    return with_motions(log, _rotated(log.delta[1:, :2], degrees * DEGREE), log.delta[1:, 2])


def _shorter(log: Log, factor: float) -> Log:
    return with_motions(log, log.delta[1:, :2] / factor, log.delta[1:, 2])


def _nearer(log: Log, factor: float) -> Log | None:
    """With shorter ranges, whose noise goes with them unless it is one constant."""
    if not len(log.ids):
        return None
    sd = np.sqrt(log.z_cov[:, 0, 0])
    constant = float(np.ptp(sd)) < 0.01 * float(sd.mean())
    d = np.array([1.0 if constant else 1 / factor, 1.0])
    return replace(log, z=log.z / [factor, 1.0], z_cov=log.z_cov * np.outer(d, d))


def _bearings_to_degrees(log: Log, _: float) -> Log | None:
    """A reader that expects degrees has divided; one that expects radians refuses degrees."""
    if not len(log.ids):
        return None
    return replace(log, z=np.column_stack((log.z[:, 0], wrap(log.z[:, 1] / DEGREE))))


def _headings_from_degrees(log: Log, _: float) -> Log:
    told = _headings(log)[:-1]
    return with_motions(log, _rotated(log.delta[1:, :2], (1 - DEGREE) * (told - told[0])), DEGREE * log.delta[1:, 2])


def _rates_from_degrees(log: Log, _: float) -> Log:
    """With motions along arcs that turn less."""
    told = log.delta[1:, 2]
    arcs = log.delta[1:, :2] * (np.sinc(DEGREE * told / tau) / np.sinc(told / tau))[:, None]
    return with_motions(log, _rotated(arcs, (DEGREE - 1) * told / 2), DEGREE * told)


def _from_the_world(log: Log, direction: float) -> Log:
    return with_motions(log, _rotated(log.delta[1:, :2], -_headings(log)[:-1] - direction), log.delta[1:, 2])


def _from_clockwise(log: Log, direction: float) -> Log:
    """With headings h = direction - h': of the way w in the world R(-h') w was told, and R(-h) w is right."""
    turned = 2 * _headings(log)[:-1] - direction
    return with_motions(log, _rotated(log.delta[1:, :2], turned), -log.delta[1:, 2])


def _from_swapped(log: Log, direction: float) -> Log:
    """With ways w = R(direction) diag(1, -1) w' in the world, and the headings that were told."""
    told = _headings(log)[:-1]
    ways = _rotated(log.delta[1:, :2], told) * [1.0, -1.0]
    return with_motions(log, _rotated(ways, direction - told), log.delta[1:, 2])


def _along_the_path(log: Log, _: float) -> Log | None:
    """With headings along the path, as of a robot that does not move sideways, where the log's never change."""
    if float(np.ptp(_headings(log))) > NEVER:
        return None
    ways = _rotated(log.delta[1:, :2], _headings(log)[:-1])
    moving = np.hypot(*ways.T) > 0
    if not moving.any():
        return None
    at = np.maximum.accumulate(np.where(moving, np.arange(len(ways)), np.flatnonzero(moving)[0]))
    along = np.unwrap(np.arctan2(ways[at, 1], ways[at, 0]))
    at_steps = np.concatenate((along[:1], (along[1:] + along[:-1]) / 2, along[-1:]))
    return with_motions(log, _rotated(ways, -at_steps[:-1]), np.diff(at_steps))


def _earlier(log: Log, delay: float) -> Log | None:
    """With sightings that were taken before the time of their step, the robot having moved evenly since."""
    if not len(log.ids):
        return None
    path, step = log.dead_reckoned(), log.sighting_step
    path[:, 2] = _headings(log)
    time = np.clip(log.t[step] - delay, log.t[0], log.t[-1])
    taken = np.column_stack([np.interp(time, log.t, column) for column in path.T])
    moved = between(path[step], taken)
    r, bearing = log.z.T
    xy = moved[:, :2] + _rotated(np.column_stack((r * np.cos(bearing), r * np.sin(bearing))), moved[:, 2])
    return replace(log, z=np.column_stack((np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0]))))


def _wheel_reversed(log: Log, base: float) -> Log:
    """With the way of one wheel of the other sign, the right one's, or the left one's for a negative base.

    The left wheel's speed is v - w base / 2, the right one's v + w base / 2.
    """
    turns = log.delta[1:, 2]
    arc = np.hypot(*log.delta[1:, :2].T) * np.sign(log.delta[1:, 0]) / np.sinc(turns / tau)
    arc, turns = -turns * base / 2, -2 * arc / base
    chord = arc * np.sinc(turns / tau)
    return with_motions(log, np.column_stack((chord * np.cos(turns / 2), chord * np.sin(turns / 2))), turns)


def on_one_circle(log: Log) -> bool:
    """Tells if every motion is an arc of the same circle, as where the counts of one wheel stand still.

    The chord of an arc is the circle's diameter times the sine of half its turn, which may be wrapped.
    """
    chord, sine = np.hypot(*log.delta[1:, :2].T), np.abs(np.sin(log.delta[1:, 2] / 2))
    moving = chord > 1e-3 * chord.max(initial=0.0)
    if moving.sum() < FEWEST:
        return False
    curvature = 2 * sine[moving] / chord[moving]
    typical = float(np.median(curvature))
    exact = np.abs(curvature - typical) < EXACT * typical
    return 1 / typical < WIDEST and float(exact.mean()) > MOST if typical > 0 else False


def _headings(log: Log) -> Array:
    """(n,) rad, not wrapped, by dead reckoning."""
    return log.prior.pose[2] + np.concatenate(([0.0], np.cumsum(log.delta[1:, 2])))


def _rotated(xy: Array, angle: Array | float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack((c * xy[:, 0] - s * xy[:, 1], s * xy[:, 0] + c * xy[:, 1]), axis=-1)


def _of_ways(log: Log, factor: float) -> float:
    return 2 * (len(log) - 1) * ln(factor)


def _of_ranges(log: Log, factor: float) -> float:
    return len(log.ids) * ln(factor)


def _of_turns(log: Log, _: float) -> float:
    return (len(log) - 1) * ln(1 / DEGREE)


LENGTHS = tuple(factor for factor, name in FACTORS.items() if name != "km/h")

MISTAKES = (
    Mistake("mirrored", "bearings, or turning rates, are positive to the other side", _mirrored),
    Mistake("turned", "the sensor, or the frame of the headings, is turned by 90 degrees", _turned, (90.0, -90.0)),
    Mistake("backwards", "the sensor looks backwards, or forward motions have the other sign", _turned, (180.0,)),
    Mistake("motions' unit", "motions are in {unit}", _shorter, tuple(FACTORS), squeeze=_of_ways),
    Mistake("ranges' unit", "ranges are in {unit}", _nearer, LENGTHS, squeeze=_of_ranges),
    Mistake(
        "turning rates in degrees",
        "turning rates or headings are in degrees",
        _rates_from_degrees,
        wrapped=True,
        squeeze=_of_turns,
    ),
    Mistake(
        "headings in degrees",
        "headings or turning rates are in degrees",
        _headings_from_degrees,
        wrapped=True,
        squeeze=_of_turns,
    ),
    Mistake("bearings in radians", "bearings are in radians, and were read as degrees", _bearings_to_degrees),
    Mistake("world", "motions are in the world's frame, not in the robot's", _from_the_world, DIRECTIONS, True),
    Mistake("clockwise", "headings are clockwise, as a compass's", _from_clockwise, DIRECTIONS, True),
    Mistake("axes", "x and y are swapped, or one of them has the other sign", _from_swapped, DIRECTIONS, True),
    Mistake("constant heading", "the robot looks along its path, where its headings never change", _along_the_path),
    Mistake("late", "sightings are {delay}", _earlier, DELAYS, True),
    Mistake("wheel reversed", "the counts of one wheel have the other sign", _wheel_reversed, EITHER, True, True),
)


def sentence(mistake: Mistake, number: float) -> str:
    """Says what is wrong, with the number."""
    late = f"{abs(number):.2g} s {'late' if number > 0 else 'early'}"
    return mistake.words.format(unit=FACTORS.get(number, ""), delay=late)
