"""Says in words which errors of sensor and wheels stay the same."""

from collections.abc import Iterator

import numpy as np

from ...datasets.noise.systematic import NAMES
from .estimated import Estimated
from .fit import SystematicFit

DEGREE = np.pi / 180

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


def clause(fit: SystematicFit, name: str) -> str:
    """A sentence on an error that is told, without its capital and full stop."""
    unit, symbol, sentence, signs = FORMS[name]
    found = fit.estimates[name]
    by = "" if fit.scaled else " by the other: which of both is wrong, no log without a true path tells"
    size = f"{_digits(abs(found.value), found, unit)} ± {_digits(_half(found), found, unit)} {symbol}"
    return sentence.format(size, of=signs[found.value < 0], by=by)


def rows(fit: SystematicFit) -> Iterator[tuple[str, Estimated, str]]:
    """Yields title, estimate and unit of all that are told."""
    for name in NAMES:
        if name in fit.estimates:
            unit, symbol, *_ = FORMS[name]
            yield TITLES[name], Estimated(*(value / unit for value in fit.estimates[name])), symbol


def _half(found: Estimated) -> float:
    return (found.high - found.low) / 2


def _digits(value: float, found: Estimated, unit: float) -> str:
    """The value in its unit, to two digits of the interval."""
    places = max(0, 1 - int(np.floor(np.log10(max(_half(found) / unit, 1e-12)))))
    return f"{value / unit:.{places}f}"
