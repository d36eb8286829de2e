"""Chooses frames to keep: varied ones for a contact sheet, and some without markers for a diagnosis."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import FrameSightings
from .marker_frames import annotated

PICTURES = 12
COLUMNS = 4
WIDTH = 480  # px, of a picture
STRETCHES = 8  # at most; beyond, pairs are merged, so that memory stays bounded however long the recording
_GAP = 8  # px between pictures


class Picture(NamedTuple):
    """A chosen frame, and its counts."""

    number: int  # of the frame among those used
    t: float  # s
    kept: int  # markers in the log
    far: int  # too far away for it
    rejected: int
    image: Image  # (h, w, 3) BGR
    camera: str = ""  # its name, of several


@dataclass
class ContactSheet:
    """Chooses frames as they pass.

    Of every stretch of the recording it keeps at most four: the frame with the most markers, that with the fewest, that
    with the most rejections, and the first.
    """

    _stretches: list[list[Picture]] = field(default_factory=list[list[Picture]])
    _frames: int = 0
    _length: int = 1  # frames a stretch

    def observe(self, seen: FrameSightings) -> None:
        """Considers a frame, if it has an image; it is drawn only if it is kept."""
        if seen.frame.image is None:
            return
        if self._frames % self._length == 0:
            if len(self._stretches) == STRETCHES:
                pairs = zip(self._stretches[::2], self._stretches[1::2], strict=True)
                self._stretches = [_best([*one, *other]) for one, other in pairs]
                self._length *= 2
            self._stretches.append([])
        kept = int(seen.kept.sum())
        counts = kept, len(seen.kept) - kept, seen.rejected.total()
        new = Picture(self._frames, seen.frame.t, *counts, _NOT_DRAWN, seen.frame.camera)
        best = _best([*self._stretches[-1], new])
        self._stretches[-1] = [
            one._replace(image=annotated(seen, WIDTH)) if one.image is _NOT_DRAWN else one for one in best
        ]
        self._frames += 1

    def __len__(self) -> int:
        return sum(map(len, self._stretches))

    def pictures(self) -> list[Picture]:
        """Returns up to PICTURES, in order: the fullest of each stretch, some with rejections, some empty, others."""
        chosen = [max(stretch, key=_fullness) for stretch in self._stretches]
        half = (PICTURES - len(chosen) + 1) // 2
        for kind, most in (("rejecting", half), ("empty", PICTURES), ("other", PICTURES), ("rejecting", PICTURES)):
            taken = {one.number for one in chosen}
            left = [one for stretch in self._stretches for one in stretch if one.number not in taken]
            chosen += _spread([one for one in left if _kind(one) == kind], min(most, PICTURES - len(chosen)))
        return sorted(chosen)


def sheet(pictures: list[Picture]) -> Image:
    """Tiles all in one image, row by row, on black."""
    height, width = (max(one.image.shape[axis] for one in pictures) for axis in (0, 1))
    columns = min(COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    whole = np.zeros((rows * (height + _GAP) + _GAP, columns * (width + _GAP) + _GAP, 3), np.uint8)
    for place, one in enumerate(pictures):
        top, left = (k * (size + _GAP) + _GAP for k, size in zip(divmod(place, columns), (height, width), strict=True))
        whole[top : top + one.image.shape[0], left : left + one.image.shape[1]] = one.image
    return whole


def _best(candidates: list[Picture]) -> list[Picture]:
    chosen = {one.number: one for one in (max(candidates, key=_fullness), min(candidates, key=_fullness))}
    chosen |= {one.number: one for one in [max(candidates, key=lambda one: one.rejected)] if one.rejected}
    chosen[candidates[0].number] = candidates[0]
    return sorted(chosen.values())


def _fullness(one: Picture) -> tuple[int, int]:
    return one.kept, one.far


def _kind(one: Picture) -> str:
    return "rejecting" if one.rejected else "other" if one.kept else "empty"


def _spread(candidates: list[Picture], count: int) -> list[Picture]:
    if len(candidates) <= count:
        return candidates[: max(count, 0)]
    return [candidates[k] for k in np.linspace(0, len(candidates) - 1, count).round().astype(int)] if count > 0 else []


_NOT_DRAWN: Image = np.zeros((0, 0, 3), np.uint8)


MOST = 12


@dataclass
class EmptyFrames:
    """Up to MOST frames without markers, spread over the recording."""

    images: list[Image] = field(default_factory=list[Image])
    _every: int = 1
    _seen: int = 0

    def observe(self, seen: FrameSightings) -> None:
        """Keeps the frame's image if it is one of every so many."""
        if seen.sightings or seen.frame.image is None:
            return
        if self._seen % self._every == 0:
            if len(self.images) == MOST:
                self.images = self.images[::2]
                self._every *= 2
            if self._seen % self._every == 0:
                self.images.append(seen.frame.image)
        self._seen += 1
