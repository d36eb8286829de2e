"""Diagnoses recordings in which hardly any marker was found, in sentences for the user."""

from collections.abc import Sequence

import cv2
import numpy as np

from ..camera.camera import Camera
from ..camera.sharpness import blur
from .aruco import Image, Sighting
from .decoding import Reading, decode
from .markers import Markers, find

MOST = 12  # most frames examined, spread over those given

DARK, BRIGHT, FLAT = 40, 250, 25
"""Grey levels: a frame of which 99 % is darker is too dark; brighter is saturated; a frame with less range is flat."""

SATURATED = 0.5  # share of saturated pixels from which a frame is over-exposed

BLURRED = 2.2
"""px of `sharpness.blur`.

Rendered frames of a room, 640 px wide, measure 0.5 in focus; at a lens blur of 2 px they measure 1.6, and two thirds of
the markers are still found; at 3.5 px, 2.3 to 2.7, and hardly any.
"""

READABLE = 15  # px, side of a marker that is found in four of five frames
NEAR, FAR = 0.05, 30.0  # m, distances at which no camera reads a marker printed on paper


def diagnose(images: Sequence[Image], markers: Markers, camera: Camera) -> list[str]:
    """Returns sentences on what is wrong with frames in which hardly any marker was found; none where markers are read.

    `images` are grey or BGR; at most `MOST` are examined. Another dictionary is only named if its readings are
    significant. InputError for an unknown dictionary.
    """
    if not images:
        return []
    chosen = [images[index] for index in np.linspace(0, len(images) - 1, min(MOST, len(images))).astype(int)]
    greys = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image for image in chosen]
    decoded = decode(greys, markers.dictionary, markers.opencv)
    best = next(iter(decoded.readings), None)
    if best is not None and not as_expected(best, markers):
        return [_reading(best, markers, len(chosen))]
    if best is not None and 2 * best.frames >= len(chosen):
        return []
    found = [*_exposure(greys), *_blur(greys), *_size(markers, camera)]
    if best is not None or found:
        return found
    frames = _plural(len(chosen), "frame")
    if not decoded.framed:
        return [f"nothing in {frames} looks like a marker: a black square, white all around it"]
    hold = "hold" if decoded.framed > 1 else "holds"
    unread = f"{decoded.framed} of {frames} {hold} black squares with a pattern inside that no known dictionary reads"
    return [f"{unread}; name a custom dictionary as a file or as custom[count=30,size=4,seed=0]"]


def plausible_length(sightings: Sequence[Sighting], markers: Markers) -> str | None:
    """Returns a sentence if the markers would be too near or too far to be seen: the side is not in metres.

    The median distance of all `sightings` from the camera decides; None where it is plausible, or the side unknown.
    """
    if not sightings or np.isnan(markers.side):
        return None
    distance = float(np.median([np.linalg.norm(sighting.pose[:3, 3]) for sighting in sightings]))
    if NEAR <= distance <= FAR:
        return None
    side = float(np.median([markers.side_of(sighting.id) for sighting in sightings]))
    away = f"{distance:.0f} m" if distance > 1 else f"{1000 * distance:.2g} mm"
    for unit, name in ((100, "centimetres"), (1000, "millimetres")):
        if distance > FAR and 0.03 <= side / unit <= 0.6:
            return f"the markers would be {away} away; side = {side:g} reads like {name}, {side / unit:g} m"
    return f"the markers would be {away} away; is side = {side:g} their length in metres?"


def as_expected(reading: Reading, markers: Markers) -> bool:
    """Tells if the recording's own dictionary has the markers that were read, neither mirrored nor inverted."""
    own, other = markers.opencv, find(reading.dictionary, markers.folder)
    if reading.mirrored or reading.inverted or own.markerSize != other.markerSize:
        return False
    if max(reading.ids) >= len(own.bytesList):
        return False
    return bool((own.bytesList[reading.ids] == other.bytesList[reading.ids]).all())


def _reading(reading: Reading, markers: Markers, frames: int) -> str:
    shown = ", ".join(map(str, reading.ids[:5])) + (", ..." if len(reading.ids) > 5 else "")
    count, ids = len(reading.ids), "id" if len(reading.ids) == 1 else "ids"
    facts = f"reads {_plural(count, 'marker')} in {reading.frames} of {_plural(frames, 'frame')} ({ids} {shown})"
    same = as_expected(reading._replace(mirrored=False, inverted=False), markers)
    says = "" if same else f"; the recording says {markers.dictionary}"
    name = markers.dictionary if same else reading.dictionary
    if reading.mirrored and reading.inverted:
        return f"the image is mirrored and inverted: once corrected, {name} {facts}{says}"
    if reading.mirrored:
        return f"the image is mirrored: once flipped left to right, {name} {facts}{says}"
    if reading.inverted:
        return f"the markers are white on black: once inverted, {name} {facts}{says}"
    return f"{name} {facts}{says}"


def _exposure(greys: Sequence[Image]) -> list[str]:
    """At most one sentence on the exposure; the median frame decides."""
    low, high = np.median([np.percentile(grey[::2, ::2], (1, 99)) for grey in greys], axis=0)
    bright = float(np.median([(grey >= BRIGHT).mean() for grey in greys]))
    if bright > SATURATED:
        return [f"the image is over-exposed: {bright:.0%} of a frame's pixels are saturated"]
    if high < DARK:
        return [f"the image is too dark: 99 % of a frame's pixels are below {high:.0f} of 255"]
    if high - low < FLAT:
        return [f"the image lacks contrast: nearly all grey levels are between {low:.0f} and {high:.0f} of 255"]
    return []


def _blur(greys: Sequence[Image]) -> list[str]:
    deviation = blur(greys)
    if deviation is None or deviation < BLURRED:
        return []
    seen, expected = (f"{2.56 * s:.0f}" for s in (deviation, BLURRED))  # 10 % to 90 % edge width
    return [f"the image is blurred, by the lens or by motion: even sharp edges are {seen} px wide, expected {expected}"]


def _size(markers: Markers, camera: Camera) -> list[str]:
    side = max([markers.side, *markers.sides.values()])
    reach = min(camera.focal) * side / READABLE
    if reach >= 1:
        return []
    narrow = f"a marker of {side:g} m is {READABLE} px wide at {reach:.2g} m from this camera and rarely found beyond"
    return [f"{narrow}: print them larger, or take images of more pixels"]


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' if count > 1 else ''}"
