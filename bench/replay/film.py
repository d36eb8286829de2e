"""Writes a replay as a GIF or an MP4, beside its place and moved there when complete."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.files import replaced
from .frames import INK, PAPER, RULE, SOFT, pictures
from .view import View

CODECS = ("vp09", "mp4v")  # VP9, which browsers play; else MPEG-4, which only players play
RATE = 15  # frames per second
LAST_MS = 2500  # ms that a GIF's last frame stays
SHADES = 6  # shades of each colour towards paper, in a GIF's palette, for anti-aliasing


def write_gif(path: Path, view: View) -> None:
    """Writes a GIF in a fixed palette, so that unchanged pixels cost nothing; it loops."""
    from PIL import Image

    palette = _palette(view)
    nearest = _nearest(palette)
    images: list[Any] = []
    for picture in pictures(view):
        coarse = picture >> 3
        image = Image.fromarray(nearest[coarse[..., 2], coarse[..., 1], coarse[..., 0]], "P")
        image.putpalette(palette.astype(np.uint8).ravel().tolist())
        images.append(image)
    ms = [round(1000 / RATE, -1)] * (len(images) - 1) + [LAST_MS]
    with replaced(path, ".gif") as part:
        images[0].save(part, save_all=True, append_images=images[1:], duration=ms, loop=0, optimize=True, disposal=1)


def write_mp4(path: Path, view: View) -> None:
    """Writes an MP4; InputError where this OpenCV has no codec for it."""
    with replaced(path, ".mp4") as part:
        for codec in CODECS:
            if _written(part, pictures(view), codec):
                return
        raise InputError(f"--out {path}: this OpenCV can write no MP4 with codec {' or '.join(CODECS)}.")


def _written(part: Path, frames: Iterable[Any], codec: str) -> bool:
    writer: Any = None
    try:
        for frame in frames:
            if writer is None:
                height, width = frame.shape[:2]
                writer = cv2.VideoWriter(str(part), cv2.VideoWriter.fourcc(*codec), RATE, (width, height))
                if not writer.isOpened():
                    return False
            writer.write(frame)
    finally:
        if writer is not None:
            writer.release()
    return part.is_file() and part.stat().st_size > 0


def _palette(view: View) -> Any:
    """Returns (k, 3) red, green, blue of every colour of the pictures and its shades."""
    drawn = [(*reversed(colour),) for colour in (INK, SOFT, RULE)]
    drawn += [tuple(int(p.look.colour[k : k + 2], 16) for k in (1, 3, 5)) for p in view.panels] + [(168, 59, 0)]
    weights = np.linspace(1, 0, SHADES, endpoint=False)[:, None]
    shades = [weights * colour + (1 - weights) * np.array(PAPER) for colour in dict.fromkeys(drawn)]
    return np.rint(np.concatenate((np.array([PAPER]), *shades)))[:255]


def _nearest(palette: Any) -> Any:
    """Returns (32, 32, 32) uint8: the palette's nearest entry of each colour, by its five highest bits."""
    step = np.arange(32) * 255 / 31
    colours = np.stack(np.meshgrid(step, step, step, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    found = [((piece - palette) ** 2).sum(axis=-1).argmin(axis=-1) for piece in np.array_split(colours, 32)]
    return np.concatenate(found).astype(np.uint8).reshape(32, 32, 32)
