"""Says in words which errors of sensor and wheels stay the same."""

from collections.abc import Iterator, Mapping

import numpy as np

from ...datasets.noise.systematic import NAMES
from ..words.numerals import listed, number
from .estimated import Estimated
from .fit import SystematicFit
from .frame import Frame
from .late_parts import Late
from .motions_along import SURE

DEGREE = np.pi / 180
RANGES = ("range_scale", "range_offset")

MANYFOLD = 2.0
"""The factor from which on a scale is said as one, and not in %."""

UNITS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37, "feet": 3.281, "kilometres": 0.001}
"""Units that a log may have in place of metres, and how many of each a metre is."""

NEAR = 1.2
"""The factor up to which a scale is near that of a unit: there is a scale of the sensor itself, too."""

FORMS = {
    "x": (1.0, "m", "the sensor sits {} {of} the robot's origin", ("ahead of", "behind")),
    "y": (1.0, "m", "the sensor sits {} to the {of} of the robot's origin", ("left", "right")),
    "yaw": (DEGREE, "degrees", "the sensor looks {} to the {of} of ahead", ("left", "right")),
    "delay": (1e-3, "ms", "the sensor's clock is {} {of}", ("late", "early")),
    "range_offset": (1.0, "m", "ranges are {} too {of}", ("long", "short")),
    "range_scale": (0.01, "%", "ranges are {} too {of}{by}", ("long", "short")),
    "bearing_scale": (0.01, "%", "bearings are {} too {of}", ("large", "small")),
    "wheel_scale": (0.01, "%", "the odometry's way is {} too {of}{by}", ("long", "short")),
    "turn_scale": (0.01, "%", "the odometry's turns are {} too {of}, as with a wrong base", ("large", "small")),
    "drift": (DEGREE, "degrees a metre", "the odometry turns {} to the {of}, as wheels unlike do", ("left", "right")),
    "heading": (DEGREE, "degrees", "the robot drives {} to the {of} of its heading", ("left", "right")),
    "lag": (1e-3, "ms", "the odometry is {} {of}", ("late", "ahead of the motion, as commands are")),
}
"""Unit, its name, the sentence as a clause, and the words for an error above 0 and below."""

TITLES = {
    "x": "sensor: place ahead of the origin",
    "y": "sensor: place to the left",
    "yaw": "sensor: direction",
    "delay": "sensor: delay",
    "range_offset": "ranges: offset",
    "range_scale": "ranges: scale",
    "bearing_scale": "bearings: scale",
    "wheel_scale": "odometry: scale of the way",
    "turn_scale": "odometry: scale of turns",
    "drift": "odometry: drift",
    "heading": "motion beside the heading",
    "lag": "odometry: delay",
}


def sentences(fit: SystematicFit) -> Iterator[str]:
    """Yields a sentence for each error that is certain."""
    for name in fit.certain:
        yield f"{clause(fit, name)[0].upper()}{clause(fit, name)[1:]}."
    for name in RANGES:
        apart = [k for k, one in fit.each.items() if name in one and _differs(one, fit, name)]
        parts = [
            f"{_size(fit.each[k][name], name)} too {FORMS[name][3][fit.each[k][name].value < 0]} to landmark {k}"
            for k in apart
        ]
        if parts:
            yield f"Not all landmarks' ranges are alike: they are {listed(parts)}."


def _differs(one: Mapping[str, Estimated], fit: SystematicFit, name: str) -> bool:
    """Tells if the intervals of a landmark's error and of all landmarks' are apart."""
    own, all_ = one[name], fit.estimates[name]
    return own.low > all_.high or own.high < all_.low


def clause(fit: SystematicFit, name: str) -> str:
    """A sentence on an error that is told, without its capital and full stop."""
    *_, sentence, signs = FORMS[name]
    found = fit.estimates[name]
    unit = _unit(found.value, name)
    by = "" if fit.scaled else " by the other: which of both is wrong, no log without a true path tells"
    return sentence.format(_size(found, name), of=signs[found.value < 0], by=by) + (f": {unit}?" if unit else "")


def of_late(found: Late, noun: str) -> str:
    """Says how late ranges or bearings alone are, whose clock that is by the odometry, and what takes it off.

    A sentence without its capital and full stop.
    """
    delay, half = abs(found.delay.value), (found.delay.high - found.delay.low) / 2
    size = f"{_digits(delay, found.delay, 1.0)} ± {_digits(half, found.delay, 1.0)} s"
    side, other = ("late", "early") if found.delay.value > 0 else ("early", "late")
    if found.own < -SURE:
        return f"the true path is {size} {other} by {noun} alone and by the odometry"
    doubt = "" if found.own > SURE else f", or the true path as {other}, which the odometry does not tell"
    option = f"{found.delay.value:.{_places(found.delay, 1.0)}f}"
    return f"{noun} alone are {size} {side}{doubt}; option sensor_delay={option} of csv takes it off"


def of_frame(frame: Frame) -> str:
    """Says which point and heading a true path likely has."""
    size = {name: _size(one, name) for name, one in frame.estimates.items()}
    side = {name: FORMS[name][3][one.value < 0] for name, one in frame.estimates.items()}
    place = [f"{size['x']} {side['x']}"] if "x" in size else []
    place += [f"{size['y']} to the {side['y']} of"] if "y" in size else []
    parts = [f"is that of a point {' and '.join(place)} the robot's origin"] if place else []
    if "yaw" in size:
        parts.append(f"has a heading {size['yaw']} to the {side['yaw']} of where the robot drives")
    likely = " and ".join(parts)
    return f"The true path likely {likely}, as sightings and motions tell without it; all else is by the robot's own."


def rows(fit: SystematicFit) -> Iterator[tuple[str, Estimated, str]]:
    """Yields title, estimate and unit of all that are told."""
    for name in NAMES:
        if name in fit.estimates:
            yield TITLES[name], *_in_its_unit(fit.estimates[name], name)
    for landmark, found in fit.each.items():
        for name in RANGES:
            if name in found:
                yield f"{TITLES[name]}, landmark {landmark}", *_in_its_unit(found[name], name)


def rows_of_frame(frame: Frame) -> Iterator[tuple[str, Estimated, str]]:
    """Yields title, estimate and unit of a true path's point and heading."""
    for name, one in frame.estimates.items():
        yield TITLES[name].replace("sensor", "true path"), *_in_its_unit(one, name)


def _in_its_unit(found: Estimated, name: str) -> tuple[Estimated, str]:
    unit, symbol, *_ = FORMS[name]
    return Estimated(*(value / unit for value in found)), symbol


def _size(found: Estimated, name: str) -> str:
    """The size of an error with its interval and unit; a scale beyond MANYFOLD as a factor."""
    unit, symbol, *_ = FORMS[name]
    factor = _factor(found.value, name)
    if factor >= MANYFOLD:
        return f"{number(factor)} times"
    return f"{_digits(abs(found.value), found, unit)} ± {_digits(_half(found), found, unit)} {symbol}"


def _factor(value: float, name: str) -> float:
    """By how much what is measured is too long or too short, at least 1; of an error that is no scale 1."""
    factor = 1 + value
    if not name.endswith("_scale") or factor <= 0:
        return 1.0
    return max(factor, 1 / factor)


def _unit(value: float, name: str) -> str:
    """The unit that lengths would have that are so much too long or too short; "" for none."""
    if name not in ("range_scale", "wheel_scale") or _factor(value, name) < MANYFOLD:
        return ""
    return next((unit for unit, size in UNITS.items() if 1 / NEAR < (1 + value) / size < NEAR), "")


def _half(found: Estimated) -> float:
    return (found.high - found.low) / 2


def _digits(value: float, found: Estimated, unit: float) -> str:
    """The value in its unit, to two digits of the interval."""
    return f"{value / unit:.{_places(found, unit)}f}"


def _places(found: Estimated, unit: float) -> int:
    """The digits behind the point that two digits of the interval have, of exact logs 6."""
    return min(max(0, 1 - int(np.floor(np.log10(max(_half(found) / unit, 1e-12))))), 6)
