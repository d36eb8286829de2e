"""The frames of several cameras in the order of their times."""

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from ...frontend.markers.pipeline import Frame

SAME = 1e-6
"""s, at most, between times that are one: clocks and offsets of cameras that are triggered together are rounded."""


@dataclass(frozen=True, eq=False)
class InOrder:
    """Frames that are read on demand, one of each camera ahead; those of one time have the first one's, exactly."""

    cameras: Sequence[Iterable[Frame]]  # each in order
    said: Sequence[list[str]]  # each camera's remarks; they grow while its frames are read
    remarks: list[str]  # of all of them, complete at the end

    def __iter__(self) -> Iterator[Frame]:
        before = None
        for frame in heapq.merge(*self.cameras, key=lambda frame: frame.t):
            same = before is not None and frame.camera != before.camera and frame.t - before.t <= SAME
            before = frame._replace(t=before.t) if before is not None and same else frame
            yield before
        new = dict.fromkeys(one for said in self.said for one in said)
        self.remarks.extend(one for one in new if one not in self.remarks)
