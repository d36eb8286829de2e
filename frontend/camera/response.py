"""A camera's response: the grey levels it makes of light at edges and in flat areas, from a calibration."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError

BRIGHTEST = 255.0  # grey levels, of white

GAMMAS, SHARPENINGS, BLURS = (0.3, 5.0), (-1.0, 5.0), (0.05, 50.0)
"""Smallest and largest values that a camera may have; blurs in px."""


class Measured(NamedTuple):
    """A value and its standard deviation."""

    value: float
    sd: float


@dataclass(frozen=True)
class Response:
    """The tone curve, the sharpening, the blur and the noise of a camera.

    A grey level is the light to the power of 1 / gamma. Sharpening adds so many times the difference between the
    picture and a blurred one. The noise of a flat area of grey level g has the variance `noise` + `noise_by_grey` g.
    """

    gamma: Measured
    sharpening: Measured
    blur: Measured  # px, standard deviation, in a picture of a board that is in focus
    noise: Measured | None = None  # squared grey levels, at grey level 0; None, as the next: unknown
    noise_by_grey: Measured | None = None  # squared grey levels per grey level

    @property
    def entries(self) -> dict[str, float]:
        """The values and their standard deviations by their names in files."""
        known = {one.name: getattr(self, one.name) for one in fields(self) if getattr(self, one.name) is not None}
        return {
            key: number for name, (value, sd) in known.items() for key, number in ((name, value), (f"{name}_sd", sd))
        }

    def variance(self, grey: float) -> float | None:
        """Squared grey levels, of the noise of a flat area; None where it is unknown."""
        if self.noise is None or self.noise_by_grey is None:
            return None
        return self.noise.value + self.noise_by_grey.value * grey


def read_response(given: Mapping[str, Any], where: str) -> Response:
    """Reads the values of `Response.entries`, other keys left out; InputError begins with `where`."""

    def number(name: str, fault: Callable[[float], bool], expected: str) -> float:
        if name not in given:
            raise InputError(f"{where}: found no {name}, expected {expected}")
        try:
            value = float(given[name])
        except (TypeError, ValueError, OverflowError):
            value = np.nan
        if not np.isfinite(value) or fault(value):
            raise InputError(f"{where}: {name}: found {given[name]!r}, expected {expected}")
        return value

    def measured(name: str, low: float, high: float) -> Measured:
        expected = f"a number from {low:g} to {high:g}" if np.isfinite(high) else "a number"
        value = number(name, lambda found: not low <= found <= high, expected)
        return Measured(value, number(f"{name}_sd", lambda found: found < 0, "a number, 0 or more"))

    known = Response(measured("gamma", *GAMMAS), measured("sharpening", *SHARPENINGS), measured("blur", *BLURS))
    if "noise" not in given and "noise_by_grey" not in given:
        return known
    noise, by_grey = (measured(name, -np.inf, np.inf) for name in ("noise", "noise_by_grey"))
    for grey in (0.0, BRIGHTEST):
        variance = noise.value + by_grey.value * grey
        if variance < 0:
            raise InputError(
                f"{where}: noise: found the variance {variance:g} at grey level {grey:g}, expected 0 or more"
            )
    return Response(known.gamma, known.sharpening, known.blur, noise, by_grey)
