"""Images with their times, read when they are needed, and pairs of a colour and a depth image."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[Any]


class Flaw(NamedTuple):
    """Why an image is not used."""

    reason: str  # of all such images, to be counted: "depth images of 8 bits"
    found: str  # of this one: "has 8 bits, expected 16"


class Shot(NamedTuple):
    """An image: `load` returns it, or why it cannot be used."""

    t: float  # s
    name: str  # in messages: the file, or the message
    load: Callable[[], Pixels | Flaw]


UNPAIRED, UNUSED = "images without a depth image", "depth images without an image"


def pairs(
    images: Iterable[Shot], depths: Iterable[Shot], within: float, left_out: Counter[str]
) -> Iterator[tuple[Shot, Shot]]:
    """Joins images and depth images that are each other's nearest in time and at most `within` s apart.

    Both are in the order of time; one of each is held at a time. `left_out` counts the others.
    """
    waiting, following = iter(images), iter(depths)
    image, depth = next(waiting, None), next(following, None)
    coming = next(waiting, None)
    later = next(following, None)
    while image is not None and depth is not None:
        apart = abs(depth.t - image.t)
        if later is not None and abs(later.t - image.t) < apart:  # a better one for this image
            left_out[UNUSED] += 1
            depth, later = later, next(following, None)
        elif coming is not None and abs(depth.t - coming.t) < apart:  # this one is for a better image
            left_out[UNPAIRED] += 1
            image, coming = coming, next(waiting, None)
        elif apart <= within:
            yield image, depth
            image, coming = coming, next(waiting, None)
            depth, later = later, next(following, None)
        elif image.t < depth.t:
            left_out[UNPAIRED] += 1
            image, coming = coming, next(waiting, None)
        else:
            left_out[UNUSED] += 1
            depth, later = later, next(following, None)
    for reason, ends, rest in ((UNPAIRED, (image, coming), waiting), (UNUSED, (depth, later), following)):
        if count := sum(one is not None for one in ends) + sum(1 for _ in rest):
            left_out[reason] += count


def in_metres(pixels: Pixels, units: float) -> NDArray[np.float32] | Flaw:
    """The depth (h, w), m, of an image of 16-bit integers, of which `units` are a metre, or of floats in metres.

    0 where there is none: 0, negative, infinite or not a number in the image.
    """
    if pixels.ndim == 3 and pixels.shape[2] > 1:
        return Flaw("depth images of several values", f"has {pixels.shape[2]} values in a pixel, expected one")
    pixels = pixels.reshape(pixels.shape[:2])
    if pixels.dtype.kind == "f":
        depth = np.where(np.isfinite(pixels) & (pixels > 0), pixels, 0).astype(np.float32)
    elif pixels.dtype.itemsize == 2:
        depth = (pixels.astype(np.float64) / units).astype(np.float32)
    else:
        return Flaw("depth images of 8 bits", f"has {8 * pixels.dtype.itemsize} bits in a pixel, expected 16")
    if not depth.any():
        return Flaw("depth images without any depth", "has no depth anywhere, expected some")
    return depth
