"""Ground truth, or what there is in its place."""

from typing import Literal, NamedTuple

from ..relations import Relations
from ..se2 import Array, Ints
from .landmarks import Map


class Truth(NamedTuple):
    """Ground truth, for evaluation only: no backend sees it.

    `t` is a subset of the log's times: steps in a gap of the ground truth are left out. Entries match steps of equal t.
    """

    t: Array  # (m,) s
    poses: Array  # (m, 3)
    map: Map | None = None  # true landmark positions
    assigned: Ints | None = None  # (s,) true id of every sighting, unknown ones included
    kind: Literal["truth", "reference", "relations"] = "truth"  # "reference": the batch optimum of a log without truth
    places: Literal["truth", "reference"] = "truth"  # of the map; landmarks may be surveyed though the path is unknown
    words: str = ""  # the reference, unless it is simply the batch optimum; the sensor of truth that has errors, "GPS"
    moving: Ints | None = None  # (m,) ids of landmarks that move; the map has them where they were first sighted
    relations: Relations | None = None  # of kind "relations": no path is known, but how some poses lie to one another
    false_loops: Ints | None = None  # (f,) the rows of loop closures that are false, ascending; None: not known
    assigned_partial: Ints | None = None  # (p,) as `assigned`, of the partial sightings

    @property
    def exact(self) -> bool:
        """True for ground truth whose own errors are negligible: it tells if covariances are as stated."""
        return self.kind == "truth" and not self.words
