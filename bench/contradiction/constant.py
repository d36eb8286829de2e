"""Errors of a sensor and of wheels that stay the same, and are as large as the noise that a log states.

They are looked for by the true path, or by the known places of landmarks around a robust fit.
"""

import contextlib
from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from ...core.factors import Log, Map, Truth
from ...core.se2 import Array, compose
from ...core.truth.errors import named, rows_of, sighting_errors
from ...datasets.noise.systematic import NAMES, SENSOR, Systematic, corrected
from ..measure.landmark_places import comparable
from ..measure.stated_noise import squares_in, typical_scale
from ..systematic.fit import CERTAIN, SystematicFit, fitted, of_estimate, of_truth
from ..systematic.motions_along import SURE, by_truth, ratio, unlike
from ..systematic.places import places_of
from ..systematic.system import System
from ..systematic.weight import Weight, weight
from ..systematic.words import clause
from ..words.numerals import listed, number
from .explain import OUTLYING
from .fit import FAR
from .truth import FROM_TRUTH

AS_LARGE = 1.0
"""Weight of errors from which on they matter: J per degree of freedom is then 2, at which a log contradicts itself."""

SEEN = 1.1
"""Typical error by truth, over what is stated, below which none is that large: with an error of weight 1 it is 1.13
for motions and 1.20 for sightings, without any noise."""

LEFT = 0.5
"""Share of the squares of typical errors by truth that is left without errors that matter, at most: they are most of
it."""

MOVING = ("x", "y", "delay")
"""Errors of a sensor that a true path has as well which is of another place on the robot, or whose clock is off."""

MOST = 300
"""Landmarks of a log without a true path, which are then fitted all together: 1,000 would take half a minute."""


class Constant(NamedTuple):
    """Errors that are certain, and the log without them."""

    fit: SystematicFit
    weight: Weight
    matter: Sequence[str]  # those as large as the noise that is stated
    log: Log

    @property
    def sentence(self) -> str:
        """Says which errors matter, how much, and what to do; "" where none does."""
        if not self.matter:
            return ""
        by = "the true path" if self.fit.by_truth else "the known places of landmarks"
        sizes = [
            f"{number(size)} times the stated noise of {kind}"
            for kind, size in self.weight._asdict().items()
            if size >= AS_LARGE
        ]
        found = ", and ".join(clause(self.fit, name) for name in self.matter)
        return f"by {by} {found}: this is {listed(sizes)}, and no noise; `bench noise LOG --apply FOLDER` corrects it"


def constant(log: Log, truth: Truth | None, fit: tuple[Array, Map] | None, *, thorough: bool) -> Constant | None:
    """The errors of a log that are certain; None without any, and where they do not explain what they should.

    `fit` is a path (n, 3) and map of the log where its own is not known: with them, by known places, errors are looked
    for if `thorough`; by the true path otherwise only where the log's errors are as large as some that matter.
    """
    with contextlib.suppress(np.linalg.LinAlgError):  # covariances that rounding has made singular
        return _constant(named(log, truth), truth, fit, thorough=thorough)
    return None


def _constant(log: Log, truth: Truth | None, fit: tuple[Array, Map] | None, *, thorough: bool) -> Constant | None:
    system, before, places = None, list[_Off](), None
    if truth is not None and len(truth.t) > 1:
        before = _Off.of(log, truth)
        system = of_truth(log, truth) if thorough or any(one.large for one in before) else None
    elif thorough and fit is not None and _fitted_quickly(log, fit[1]):
        places = places_of(log, truth, fit[1])
        system = None if places is None else of_estimate(log, *fit, places)
    found = None if system is None else fitted([system])
    if system is None or found is None or not found.certain:
        return None
    of, right = weight(log, found.errors), corrected(log, found.errors)
    matter = list(_mattering(log, found, of))
    if matter and truth is not None and before:
        kinds = [kind for kind, size in of._asdict().items() if size >= AS_LARGE]
        after = _Off.of(right, truth)
        if not any(one.explained(as_it_was, kinds) for one, as_it_was in zip(after, before, strict=True)):
            return None
        if _of_truth_s_clock(found, matter) or not _the_sensor_s(system, found.errors, matter):
            return None
    if fit is not None and places is not None and not _places_tell(log, fit[1], places, found.errors, matter):
        return None
    return Constant(found, of, matter, right)


def _fitted_quickly(log: Log, landmarks: Map) -> bool:
    return log.prior.start == "known" and log.prior.map is None and len(landmarks.ids) <= MOST


class _Off(NamedTuple):
    """Typical errors by a true path, over what is stated."""

    sightings: float
    far: float  # share of the sightings that are far out, by what is typical
    motions: float  # over windows of time

    @classmethod
    def of(cls, log: Log, truth: Truth) -> "list[_Off]":
        """Those of a log, with landmarks where its sightings have them, and at their true places where these are known.

        The first ones take a part of an error with them, the others may be wrong.
        """
        motions = unlike(log, *by_truth(log, truth)).size
        found = list[_Off]()
        for one in [truth._replace(map=None)] + [truth] * (truth.map is not None):
            errors = sighting_errors(log, comparable(log, one._replace(assigned=None)))
            squares = squares_in(errors, log.z_cov)
            size = typical_scale(squares, 2) if len(squares) else 0.0
            far = float((squares > FAR * max(size, 1.0) ** 2).mean()) if len(squares) else 0.0
            found.append(cls(size, far, motions))
        return found

    @property
    def large(self) -> bool:
        """True where they are larger than those of logs in which no error matters."""
        return max(self.sightings, self.motions) > SEEN

    def explained(self, before: "_Off", kinds: Sequence[str]) -> bool:
        """True where they are so small, and those of `kinds` so much less than `before`, that little is left to ask."""
        sizes = [(getattr(self, kind), getattr(before, kind)) for kind in kinds]
        return self.far < OUTLYING and all(size < FROM_TRUTH and size**2 < LEFT * one**2 for size, one in sizes)


def _places_tell(log: Log, landmarks: Map, places: Map, errors: Systematic, matter: Sequence[str]) -> bool:
    """True where known places are precise enough for the scales that matter; intervals are as if they were exact."""
    at = rows_of(landmarks.ids, places.ids)
    here, there = (xy[:, 0] + 1j * xy[:, 1] for xy in (landmarks.xy[at], places.xy))
    here, there = here - here.mean(), there - there.mean()
    extent = float(np.linalg.norm(here))
    left = there - np.vdot(here, there) / extent**2 * here  # of a turn and a scale
    scale_sd = float(np.linalg.norm(left)) / np.sqrt(2 * len(at) - 4) / extent
    sizes = {
        "range_scale": errors.range_scale,
        "wheel_scale": errors.wheel_scale,
        "range_offset": errors.range_offset / float(np.median(log.z[:, 0])),
    }
    return all(abs(size) > CERTAIN * scale_sd for name, size in sizes.items() if name in matter)


def _mattering(log: Log, found: SystematicFit, of: Weight) -> Iterator[str]:
    """Yields the errors of a kind that matter one by one, or the largest, where together they do."""
    for kind, names, size in (("sightings", SENSOR, of.sightings), ("motions", NAMES[len(SENSOR) :], of.motions)):
        own = {
            name: getattr(weight(log, Systematic(**{name: getattr(found.errors, name)})), kind)
            for name in found.certain
            if name in names
        }
        if size >= AS_LARGE:
            most = max(own.values())
            yield from (name for name, one in own.items() if one >= min(AS_LARGE, most))


def _of_truth_s_clock(found: SystematicFit, matter: Sequence[str]) -> bool:
    """True where sensor and odometry are late alike by the true path: then its clock is off."""
    if "delay" not in matter or not {"delay", "lag"} <= set(found.certain):
        return False
    delay, lag = found.estimates["delay"], found.estimates["lag"]
    return abs(delay.value - lag.value) < (delay.high - delay.low + lag.high - lag.low) / 2


def _the_sensor_s(system: System, errors: Systematic, matter: Sequence[str]) -> bool:
    """True where the odometry tells that the true path is the robot's own, and not one of where its sensor seems to be.

    Nor of where some of the errors have it. Where its clock alone is off, the odometry has no lag left.
    """
    log, path, known = corrected(system.log, errors), system.path, np.flatnonzero(system.known)
    own = unlike(log, path, system.driven)
    turned = path[known].copy()
    turned[:, 2] = np.unwrap(turned[:, 2])
    alike = corrected(system.log, errors._replace(lag=0.0))
    moving = [name for name in MOVING if name in matter]
    for some in chain.from_iterable(combinations(moving, size + 1) for size in range(len(moving))):
        x, y, delay = (getattr(errors, name) if name in some else 0.0 for name in MOVING)
        then = np.stack([np.interp(log.t - delay, log.t[known], column) for column in turned.T], axis=-1)
        other = unlike(alike if "delay" in some else log, compose(then, np.array([x, y, 0.0])), system.driven)
        if ratio(own, other) < SURE:
            return False
    return True
