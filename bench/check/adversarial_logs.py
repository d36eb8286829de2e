"""Fifty valid but hard logs, one per row, made on demand and always the same.

Their errors are drawn from the covariances that they state, unless a row says otherwise, so that a sound method must
end near the batch answer on every one. A row that says why a sound method may give up (`may_end`) lets it end with a
named reason instead.
"""

import dataclasses
import zlib
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from .log_recipe import made_log
from .small_logs import CIRCLE, IDS, MOTION_SD, RING, SIGHTING_SD, SmallLog, around

NO_BEARING = "what stands at the robot itself has no bearing, and no derivative of one"
NOT_LINEAR = "the uncertainty spans more than any linearisation holds for"
ILL_CONDITIONED = "covariances this far apart leave a double no digits"


@dataclasses.dataclass(frozen=True)
class Adversary:
    """An adversarial log."""

    name: str
    title: str  # what is hard about it
    make: Callable[[np.random.Generator], SmallLog]
    may_end: str = ""  # why a sound method may give up with a named reason; "": it must not
    planted: float = 0.0  # standard deviations of a planted error

    @cached_property
    def made(self) -> SmallLog:
        """Makes the log and its truth."""
        return self.make(np.random.default_rng(zlib.crc32(self.name.encode())))


def _log(name: str, title: str, *, may_end: str = "", planted: float = 0.0, **how: Any) -> Adversary:
    return Adversary(name, title, lambda rng: made_log(rng, **how), may_end, planted)


def _straight(steps: int, length: float = 0.2) -> Any:
    """Returns motions (steps - 1, 3) straight on, `length` m a step."""
    return np.tile([length, 0.0, 0.0], (steps - 1, 1))


def _turning(steps: int, turn: float) -> Any:
    """Returns motions (steps - 1, 3) that turn on the spot, `turn` rad a step."""
    return np.tile([0.0, 0.0, turn], (steps - 1, 1))


def _still(steps: int) -> Any:
    return np.zeros((steps - 1, 3))


def _only(steps: int, *when: int) -> Any:
    """A column (steps, 1) that is true at the steps `when`."""
    return np.isin(np.arange(steps), when)[:, None]


def _field(landmarks: int, width: float) -> Any:
    """Spreads landmarks (landmarks, 2) evenly over a square of `width` m about the origin, as a sunflower's seeds."""
    i = np.arange(landmarks) + 0.5
    radius, angle = width / 2 * np.sqrt(i / landmarks), np.pi * (1 + np.sqrt(5)) * i
    return np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)


def _ring(landmarks: int, radius: float, about: tuple[float, float] = (0.0, 0.0)) -> Any:
    angle = 2 * np.pi * np.arange(landmarks) / landmarks
    return np.array(about) + radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)


def _circle(steps: int, radius: float) -> Any:
    turn = 2 * np.pi / (steps - 1)
    return np.tile([radius * np.sin(turn), radius * (1 - np.cos(turn)), turn], (steps - 1, 1))


def _with_bearing(bearing: float) -> Callable[[np.random.Generator], SmallLog]:
    """Makes an exact log of a landmark straight behind, at exactly this bearing at every step."""

    def make(rng: np.random.Generator) -> SmallLog:
        made = made_log(rng, _straight(60), start=(0, 0, 0), xy=[(-2.0, 0.0), (30.0, 0.0)], reach=40.0, errors=0.0)
        z = made.log.z.copy()
        z[made.log.ids == IDS[0], 1] = bearing
        return made._replace(log=_changed(made, z=z))

    return make


def _with_outlier(rng: np.random.Generator) -> SmallLog:
    made = made_log(rng)
    z = made.log.z.copy()
    z[len(z) // 2] += 50 * SIGHTING_SD[0] * np.array([1.0, 0.0])
    return made._replace(log=_changed(made, z=z))


def _with_slip(rng: np.random.Generator) -> SmallLog:
    made = made_log(rng)
    delta = made.log.delta.copy()
    delta[30, 0] += 50 * MOTION_SD[0]
    return made._replace(log=_changed(made, delta=delta))


def _changed(made: SmallLog, **columns: Any) -> Any:
    """Replaces columns of the log by read-only ones."""
    for column in columns.values():
        column.flags.writeable = False
    return dataclasses.replace(made.log, **columns)


_ALONG = np.stack((np.arange(0.0, 15.0, 3.0), np.zeros(5)), axis=1)
_SURE, _UNSURE = 1e-6, 1e3  # standard deviations: covariances of 1e-12 and 1e6
_WHEELS = (1e-4, 1e-4, 1e-4)  # m, m, rad; about what a floor leaves of an encoder's noise at rest

ADVERSARIES = (
    # ranges
    _log("zero-range", "A landmark first seen from its very place, at a range of a nanometre.", may_end=NO_BEARING,
         motions=_straight(40), start=(0, 0, 0), xy=[(1e-9, 0), (4, 3), (6, -3)], sighting_sd=(1e-3, 0.02),
         prior_sd=_SURE, motion_sd=(2e-3, 1e-3, 1e-3), reach=9.0, errors=0.0),
    _log("driven-over", "Landmarks driven straight over: range falls to nothing and bearing jumps by pi.",
         may_end=NO_BEARING, motions=_straight(60), start=(-1, 0, 0), xy=_ALONG),
    _log("a-millimetre-away", "A landmark first seen from a millimetre away, and then from afar.", may_end=NO_BEARING,
         motions=_straight(40), start=(0, 0, 0), xy=[(0, 1e-3), (4, 3), (6, -3)],
         sighting_sd=[(1e-4, 0.02), (0.02, 0.005), (0.02, 0.005)],
         prior_sd=_SURE, motion_sd=(2e-3, 1e-3, 1e-3), reach=9.0),
    _log("beyond-a-kilometre", "Landmarks one to three kilometres away.",
         xy=_ring(8, 2000.0, (1000.0, 0.0)), reach=1e4),
    _log("a-hundred-kilometres", "Landmarks a hundred kilometres away, good for the heading and nothing else.",
         xy=_ring(6, 1e5), reach=1e6, sighting_sd=(50.0, 0.002)),
    _log("near-and-far", "Landmarks at 30 cm and at 300 m in one frame.",
         xy=np.concatenate((_ring(8, 4.3), _ring(4, 300.0))), reach=1e3),
    # bearings and headings
    Adversary("bearing-exactly-pi", "A landmark straight behind, at a bearing of exactly pi.", _with_bearing(np.pi)),
    Adversary("bearing-next-to-minus-pi", "A landmark straight behind, at the number next to -pi.",
              _with_bearing(float(np.nextafter(-np.pi, 0)))),
    _log("across-the-cut", "Landmarks behind, their bearings falling on both sides of pi.",
         motions=_straight(60), start=(0, 0, 0), xy=[(-2, 0), (-3, 0.1), (-4, -0.1)], reach=20.0),
    _log("prior-heading-pi", "A start at a heading of exactly pi, and a drive straight on.",
         motions=_straight(60), start=(0, 0, np.pi), xy=_field(20, 30.0), reach=8.0),
    _log("half-turns", "A robot that turns by exactly pi at every step.",
         motions=_turning(60, np.pi), start=(0, 0, 0.1)),
    _log("spinning", "A robot that turns on the spot by 3 rad a step, thirty rounds in all.",
         motions=_turning(63, 3.0), start=(0, 0, 0)),
    _log("thirty-rounds", "Thirty rounds of a small circle.", motions=np.tile(CIRCLE * [1, 1, 4], (629, 1))),
    # standing
    _log("an-hour-standing", "An hour at 1 Hz on the spot, with a look at two landmarks every ten seconds.",
         motions=_still(3600), xy=_ring(2, 3.0), reach=9.0, sees=np.arange(3600)[:, None] % 10 == 0,
         motion_sd=_WHEELS, t=np.arange(3600.0)),
    _log("an-hour-in-the-dark", "An hour at 1 Hz on the spot with nothing in view, the wheels reporting exact zeros.",
         motions=_still(3600), sees=_only(3600, 0, 3599), motion_sd=_WHEELS, errors=0.0, t=np.arange(3600.0)),
    _log("an-hour-of-sure-wheels", "An hour on the spot, a look every ten seconds, the wheels sure of it to 1e-12.",
         may_end=ILL_CONDITIONED, motions=_still(360), motion_sd=_SURE, t=10.0 * np.arange(360)),
    _log("standing-and-leaving", "A long look from one place, then a drive among the same landmarks.",
         motions=np.concatenate((_still(300), around(60)))),
    # ids
    _log("an-id-seen-once", "Landmarks that are each seen at one step only.",
         xy=_field(60, 8.0), reach=20.0, sees=np.eye(60, dtype=bool)),
    _log("new-landmarks-every-step", "Three new landmarks at every step, and none of them twice.",
         xy=_field(180, 12.0), reach=20.0, sees=np.repeat(np.eye(60, dtype=bool), 3, axis=1)),
    _log("huge-ids", "Ids 0, 2^31, 2^32 and 2^53, the largest that a log may have.",
         ids=np.array([2**53, 0, 2**31, 2**32, 2**53 - 1, 2**31 - 1]), xy=RING[:6], reach=9.0),
    _log("one-landmark", "One landmark only, whichever way the robot goes.", xy=[(1.0, 1.0)], reach=20.0),
    _log("back-after-a-gap", "Landmarks that come back after 300 steps without any.",
         motions=around(400), sees=(np.arange(400)[:, None] < 30) | (np.arange(400)[:, None] > 330)),
    _log("another-each-time", "One landmark a step, and never the same one twice in a row.",
         reach=20.0, sees=np.arange(60)[:, None] % 12 == np.arange(12)),
    # counts
    _log("500-new-in-a-frame", "500 sightings in one frame, each of a new landmark.",
         motions=around(12), xy=_field(500, 20.0), reach=30.0, sees=_only(12, 6)),
    _log("500-known-in-a-frame", "500 sightings in one frame, and all of those landmarks seen again.",
         motions=around(10), xy=_field(500, 20.0), reach=30.0, sees=_only(10, 2, 8)),
    _log("no-sightings", "Not a single sighting.", motions=around(200), reach=0.0),
    _log("sightings-at-the-start", "Sightings at step 0 and never again.", motions=around(100), sees=_only(100, 0)),
    _log("sightings-at-the-end", "Sightings at the last step only.", motions=around(100), sees=_only(100, 99)),
    _log("one-step", "A log of one step.", motions=_still(1)),
    _log("one-step-and-nothing", "A log of one step without sightings.", motions=_still(1), reach=0.0),
    # scale
    _log("utm-coordinates", "World coordinates of half a million and five million metres.",
         start=(500_004.0, 5_000_000.0, np.pi / 2), xy=np.array([500_000.0, 5_000_000.0]) + RING),
    _log("a-world-of-millimetres", "A robot that moves a third of a millimetre a step.",
         motions=around(60) * [1e-3, 1e-3, 1], start=(4e-3, 0, np.pi / 2), xy=1e-3 * RING, reach=5e-3,
         prior_sd=(5e-5, 5e-5, 0.02), motion_sd=(2e-5, 1e-5, 0.01), sighting_sd=(5e-5, 0.02)),
    _log("a-huge-loop", "A loop of 10 km that closes after 1000 steps of drift.",
         motions=_circle(1001, 1592.0), start=(1592, 0, np.pi / 2), xy=_ring(200, 1600.0), reach=60.0,
         prior_sd=(0.05, 0.05, 1e-4), motion_sd=(0.05, 0.02, 1e-4), sighting_sd=(0.05, 0.005)),
    _log("a-long-blind-stretch", "2000 steps straight on without a landmark.",
         motions=_straight(2001), start=(0, 0, 0), xy=[(2, 2), (3, -2), (400, 3), (402, -4)],
         motion_sd=(2e-3, 1e-3, 1e-4)),
    _log("great-strides", "A hundred metres a step, among landmarks a hundred metres apart.",
         motions=around(60) * [300, 300, 1], start=(1200, 0, np.pi / 2), xy=300 * RING, reach=1500.0,
         prior_sd=(0.5, 0.5, 0.002), motion_sd=(0.5, 0.3, 0.001), sighting_sd=(1.0, 0.002)),
    # covariances
    _log("sure-sightings", "Sightings with a covariance of 1e-12.", may_end=ILL_CONDITIONED, sighting_sd=_SURE),
    _log("unsure-sightings", "Sightings with a covariance of 1e6.", sighting_sd=_UNSURE),
    _log("sure-odometry", "Odometry with a covariance of 1e-12.", may_end=ILL_CONDITIONED, motion_sd=_SURE),
    _log("unsure-odometry", "Odometry with a covariance of 1e6: its turns say nothing.", may_end=NOT_LINEAR,
         motion_sd=_UNSURE, reach=20.0),
    _log("sure-and-unsure", "Covariances of 1e-12 and of 1e6 in one frame.", may_end=ILL_CONDITIONED,
         sighting_sd=np.where(np.arange(12) % 2, _SURE, _UNSURE)[:, None]),
    _log("nearly-singular", "Odometry and sightings whose errors are correlated to 0.99.", correlation=0.99),
    _log("sure-start", "A prior with a covariance of 1e-12.", prior_sd=_SURE),
    _log("unsure-start", "A prior with a covariance of 1e6 in place.", prior_sd=(_UNSURE, _UNSURE, 0.02),
         start_errors=1e-3),
    _log("unknown-heading", "A prior that does not know the heading at all.", may_end=NOT_LINEAR,
         prior_sd=(0.05, 0.05, 3.0)),
    # worlds
    _log("a-line", "A robot that drives along a line on which all landmarks stand.",
         motions=_straight(60), start=(-1, 0, 0), xy=np.array([0.0, 1.0]) + _ALONG, reach=30.0),
    _log("two-in-one-place", "Two landmarks in one place, under two ids.", xy=np.repeat(RING[::2], 2, axis=0)),
    _log("a-given-map-of-both", "A given map, sure to 1e-12, and sightings that are as sure.", may_end=ILL_CONDITIONED,
         known_sd=_SURE, sighting_sd=_SURE),
    # errors that are larger than claimed
    Adversary("one-sighting-off", "One sighting whose range is 50 standard deviations off.", _with_outlier, planted=50),
    Adversary("one-slip", "One odometry delta that is 50 standard deviations off.", _with_slip, planted=50),
    # time
    _log("uneven-time", "Steps a microsecond and eleven days apart, in turns, since 1970.",
         t=1.7e9 + np.cumsum(np.where(np.arange(60) % 2, 1e-6, 1e6))),
)  # fmt: skip
