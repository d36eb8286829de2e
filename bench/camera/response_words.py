"""Sentences on a camera's response and on a board's ink."""

from ...frontend.boards.response_fit import BoardResponse
from ...frontend.camera.response import Measured, Response

DARK, BRIGHT = 50.0, 200.0  # grey levels of which the noise is told


def told(seen: BoardResponse | str) -> list[str]:
    """Lines on the response; one line where there is none."""
    if isinstance(seen, str):
        return [f"response to light not measured: {seen}"]
    response = seen.response
    return [
        f"tone curve of gamma {_shown(response.gamma)} (1: linear), by {seen.markers} markers in {seen.pictures} views",
        f"sharpening by {_shown(response.sharpening)} of the difference to a blurred picture (0: none)",
        f"blur {_shown(response.blur)} px (standard deviation; median of the views)",
        *_noise(response),
        f"ink: edges of the board's black are {_shown(seen.ink, 1000)} mm too far out (negative: in)",
    ]


def _noise(response: Response) -> list[str]:
    noise, by_grey = response.noise, response.noise_by_grey
    if noise is None or by_grey is None:
        return ["noise not measured: too little of the board is plain black and plain white in these views"]
    dark, bright = ((response.variance(grey) or 0.0) ** 0.5 for grey in (DARK, BRIGHT))
    variance = f"{_shown(noise)}, and {_shown(by_grey)} more per grey level"
    return [f"noise of {dark:.2g} grey levels at {DARK:g} and {bright:.2g} at {BRIGHT:g}: variance {variance}"]


def _shown(measured: Measured, scale: float = 1.0) -> str:
    """The value with its standard deviation, both to the first digit of the latter, and to two places at least."""
    value, sd = scale * measured.value, scale * measured.sd
    digits = next((n for n in range(2, 6) if sd * 10**n >= 1), 5)
    return f"{value:.{digits}f} ± {sd:.{digits}f}"
