"""Frames in which no marker was found, a few of them, to find out why."""

from dataclasses import dataclass, field

from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import Seen

MOST = 12


@dataclass
class EmptyFrames:
    """At most `MOST` of them, spread over the recording however long it is."""

    images: list[Image] = field(default_factory=list[Image])
    _every: int = 1
    _seen: int = 0

    def observe(self, seen: Seen) -> None:
        """Keep the frame's image if it is one of every so many."""
        if seen.sightings or seen.frame.image is None:
            return
        if self._seen % self._every == 0:
            if len(self.images) == MOST:
                self.images = self.images[::2]
                self._every *= 2
            if self._seen % self._every == 0:
                self.images.append(seen.frame.image)
        self._seen += 1
