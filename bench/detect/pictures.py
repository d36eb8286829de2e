"""Letters on camera images, and images as files."""

from typing import Any

import cv2

from ...frontend.markers.aruco import Image

KEPT, REFUSED = (115, 158, 0), (0, 94, 213)
"""BGR, of Okabe and Ito's colours: green for what is in the log, orange for what is not."""

WHITE, BLACK = (255, 255, 255), (0, 0, 0)

_FONT = cv2.FONT_HERSHEY_SIMPLEX


def write(picture: Any, text: str, place: tuple[int, int], scale: float) -> None:
    """Writes white letters on black; `place` is the lower left corner of the first one, px."""
    (width, height), below = extent(text, scale)
    x, y = place
    cv2.rectangle(picture, (x - 3, y - height - 2), (x + width + 2, y + below // 2), BLACK, cv2.FILLED)
    cv2.putText(picture, text, place, _FONT, scale, WHITE, _weight(scale), cv2.LINE_AA)


def extent(text: str, scale: float) -> tuple[tuple[int, int], int]:
    """Returns the width and height of a text above its line, and its depth below it, px."""
    (width, height), below = cv2.getTextSize(text, _FONT, scale, _weight(scale))
    return (width, height), below


def encoded(image: Image, suffix: str) -> bytes:
    """Encodes the image as a .png or .jpg file."""
    settings = [cv2.IMWRITE_JPEG_QUALITY, 82] if suffix == ".jpg" else []
    _, content = cv2.imencode(suffix, image, settings)
    return content.tobytes()


def _weight(scale: float) -> int:
    return max(1, round(2.2 * scale))
