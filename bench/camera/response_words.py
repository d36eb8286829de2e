"""Sentences on a camera's response and on a board's ink."""

from ...frontend.boards.response_fit import BoardResponse
from ...frontend.camera.response import Measured, Response

DARK, BRIGHT = 50.0, 200.0
"""Grey levels of which the noise is told."""


def told(seen: BoardResponse | str) -> list[str]:
    """Lines on the response; one line where there is none."""
    if isinstance(seen, str):
        return [f"response to light not measured: {seen}"]
    response = seen.response
    return [
        f"tone curve of gamma {_shown(response.gamma)} (1: linear), by {seen.markers} markers in {seen.pictures} views",
        f"sharpening of {_shown(response.sharpening)} times the edge's overshoot (0: none)",
        f"blur {_shown(response.blur)} px (standard deviation; median of the views)",
        *_noise(response),
        f"ink: the board's black is {_shown(seen.ink, 1000)} mm too large at every edge",
    ]


def _noise(response: Response) -> list[str]:
    noise, by_grey = response.noise, response.noise_by_grey
    if noise is None or by_grey is None:
        return ["noise not measured: too little of the board is plain black and plain white in these views"]
    dark, bright = (max(noise.value + by_grey.value * grey, 0.0) ** 0.5 for grey in (DARK, BRIGHT))
    variance = f"{_shown(noise)}, and {_shown(by_grey)} more per grey level"
    return [f"noise of {dark:.2g} grey levels at {DARK:g} and {bright:.2g} at {BRIGHT:g}: variance {variance}"]


def _shown(measured: Measured, scale: float = 1.0) -> str:
    """The value with its standard deviation, both to the second digit of the latter."""
    value, sd = scale * measured.value, scale * measured.sd
    digits = next((n for n in range(6) if sd * 10**n >= 1), 5) + 1
    return f"{value:.{digits}f} ± {sd:.{digits}f}"
