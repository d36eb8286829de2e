"""Expected values of a look's parameters, by which the fit of a small marker is kept in bounds.

A tiny marker does not determine all of a look. Of a camera whose response was calibrated, tone curve and sharpening are
known much better than of any camera.
"""

import math

import numpy as np

from ...core.se2 import Array
from ..camera.response import Measured, Response
from ._grey import CURL, SHARP, TONE, A, C

BLUR, LOG_BLUR_SD = 0.65, 1.0  # px, the blur that is expected, and a factor of e either way

INK_SD, TONE_SD, SHARP_SD, SLOPE_SD, BEND_SD = 0.02, 0.5, 1.0, 0.3, 0.1
"""Standard deviations: 0.3 % of the side of a marker of 4 x 4 bits for the ink; gamma 2.2 is 0.8."""

CURL_SD = 0.05
"""In sides, at a side from the middle: a marker of 0.16 m has its edges 2 mm in front of its middle, or behind it.

A frame mostly says more: of that marker 640 px wide frames say 0.05 mm at 1 m and 0.2 mm at 4 m.
"""

DRIFT = 0.1
"""Standard deviation by which a calibrated camera's tone and sharpening change from one picture to another.

By the scene, with cameras that adapt, and by what the model leaves out. Held to a hundredth of it, ranges of
rendered markers at 4 m had biases of up to 0.03 %.
"""

UNKNOWN_CAMERA = np.array([
    [math.log(BLUR), 0.0, math.log(BLUR), *[0.0] * 11],
    [*[LOG_BLUR_SD] * 3, INK_SD, TONE_SD, SHARP_SD, *[SLOPE_SD] * 2, *[BEND_SD] * 3, *[CURL_SD] * 3],
])  # fmt: skip
"""(2, 14) means and standard deviations of the look's parameters from the blur on."""

assert UNKNOWN_CAMERA.shape[1] == CURL + 3 - A


def prior_of(response: Response | None) -> Array:
    """(2, 14) means and standard deviations of the look's parameters from the blur on, for a camera's response."""
    if response is None:
        return UNKNOWN_CAMERA
    prior = UNKNOWN_CAMERA.copy()
    prior[0, [A - A, C - A]] = math.log(response.blur.value)
    tone = Measured(math.log(response.gamma.value), response.gamma.sd / response.gamma.value)
    for index, measured in ((TONE - A, tone), (SHARP - A, response.sharpening)):
        prior[:, index] = _both(Measured(*prior[:, index]), Measured(measured.value, math.hypot(measured.sd, DRIFT)))
    return prior


def _both(one: Measured, other: Measured) -> Measured:
    """Two independent measurements of the same, weighted by their variances."""
    total = one.sd**2 + other.sd**2
    value = (one.value * other.sd**2 + other.value * one.sd**2) / total
    return Measured(value, one.sd * other.sd / math.sqrt(total))
