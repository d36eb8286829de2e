"""The ids of landmarks behind data association: known and made-up ones, and which of them are of one landmark."""

from collections.abc import Collection

import numpy as np

from ...core.factors import UNKNOWN, Map
from ...core.se2 import Ints
from ..api import Constant
from .merging import Merging

FIRST = -2  # the first made-up id, unless the given map has lower ones; the next ones are below it


class Names:
    """The ids in use, and the landmarks that were taken out; a landmark without a known id has a made-up one."""

    def __init__(self, given: Collection[int], merging: Merging | None, retire: int) -> None:
        """`given` are the ids of a given map; `retire` is the steps after which a landmark sighted once is out."""
        self.next = min((FIRST, *(landmark - 1 for landmark in given)))  # of a map made without ids, too
        self.made: dict[int, int] = {}  # known id -> made-up one of the same landmark
        self.called: dict[int, int] = {}  # and the inverse
        self.retired: set[int] = set()
        self._known = set[int](given)  # ids sighted as such, or given
        self._merging, self._retire = merging, retire
        self._once: dict[int, int] = {}  # landmark sighted once -> the number of the step with sightings
        self._looks = 0  # steps with sightings

    def new(self) -> int:
        """Makes up the next id."""
        self.next -= 1
        return self.next + 1

    def own(self, ids: list[int]) -> list[int]:
        """The ids by which the backend has these landmarks: a made-up one where it was there before its known one."""
        return [self.made.get(i, i) for i in ids]

    def open(self, named: list[int]) -> list[int]:
        """The sightings to be decided on: those without an id, and those with one that comes up after made-up ones."""
        if named.count(UNKNOWN) == len(named):
            return list(range(len(named)))
        if self.next == FIRST:
            self._known.update(named)
            return [i for i, name in enumerate(named) if name == UNKNOWN]
        return [i for i, name in enumerate(named) if name == UNKNOWN or (name > UNKNOWN and name not in self._known)]

    def joined(self, own: int, landmark: int) -> int:
        """The id for a landmark of known id `own`, now sighted as such, that may be there without one."""
        self._known.add(own)
        if landmark >= UNKNOWN or landmark in self.called:
            return own
        self.made[own], self.called[landmark] = landmark, own
        return landmark

    def forget(self, named: list[int], new: set[int]) -> None:
        """Takes out landmarks that were sighted once, long ago: a first sighting says nothing of the pose."""
        self._looks += 1
        for landmark in named:
            if landmark in new:
                self._once[landmark] = self._looks
            else:
                self._once.pop(landmark, None)
        for landmark in list(self._once):  # in the order of their sightings
            if self._looks - self._once[landmark] <= self._retire:
                break
            del self._once[landmark]
            self.retired.add(landmark)

    def translated(self, ids: list[int]) -> Ints:
        """Ids as they are known now: of a made-up one whose landmark has got a known one, that."""
        if self._merging is not None and self._merging.same:
            ids = [self._merging.now(i) for i in ids]
        return np.array([self.called.get(i, i) for i in ids] if self.called else ids, np.int64)

    def as_called(self, found: Map) -> Map:
        """The map by these ids, without landmarks that were taken out."""
        if self.retired:
            keep = np.flatnonzero(~np.isin(found.ids, list(self.retired)))
            entries = np.stack((2 * keep, 2 * keep + 1), axis=1).ravel()
            cov = None if found.cov is None else found.cov[np.ix_(entries, entries)]
            found = Map(found.ids[keep], found.xy[keep], cov)
        return found._replace(ids=self.translated(found.ids.tolist())) if self.called else found

    def kept_of(self, found: Constant | None, ids: Ints) -> Constant | None:
        """Constant errors of the backend's landmarks, without those that were taken out."""
        if found is None or not self.retired or len(found.range_scale) != len(ids) or len(ids) == 1:
            return found
        keep = ~np.isin(ids, list(self.retired))

        def less(one: Constant) -> Constant:
            return one._replace(range_scale=one.range_scale[keep], range_offset=one.range_offset[keep])

        return less(found)._replace(sd=None if found.sd is None else less(found.sd))
