"""How long a run still takes, by what its cells have taken so far: they differ by dataset and by backend."""

from collections.abc import Iterable, Mapping
from statistics import fmean

Kind = tuple[str, str]
"""A cell's dataset and backend, by their labels."""


class Pace:
    """The seconds of wall time that cells took, by kind, and the kinds of those that are still to come."""

    def __init__(self, kinds: Iterable[Kind], workers: int) -> None:
        self._left = list(kinds)
        self._workers = workers
        self._taken: dict[Kind, list[float]] = {}

    def took(self, kind: Kind, seconds: float) -> None:
        """One of that kind has ended."""
        self._left.remove(kind)
        self._taken.setdefault(kind, []).append(seconds)

    def left(self) -> float | None:
        """s until the last one ends, counted from when the latest ended; None before any has.

        Cells that run side by side share the time, but it is never less than what the longest takes.
        """
        if not self._taken:
            return None
        known = {kind: fmean(seconds) for kind, seconds in self._taken.items()}
        guessed = {kind: _guess(known, kind) for kind in set(self._left)}
        awaited = [guessed[kind] for kind in self._left]
        return max(sum(awaited) / self._workers, max(awaited, default=0.0))


def _guess(known: Mapping[Kind, float], kind: Kind) -> float:
    """The mean of its own kind, else what others suggest, and at last the mean of all.

    As this backend is to another one on another dataset, so it is on this one; where no other two tell, the mean of
    those that share its dataset or its backend.
    """
    if kind in known:
        return known[kind]
    dataset, backend = kind
    told = [
        known[dataset, other] * known[place, backend] / seconds
        for (place, other), seconds in known.items()
        if seconds > 0 and (dataset, other) in known and (place, backend) in known
    ]
    alike = [seconds for other, seconds in known.items() if dataset == other[0] or backend == other[1]]
    return fmean(told or alike or known.values())


def words(seconds: float) -> str:
    """A time that is left, no finer than it is known."""
    if seconds < 10:
        return "some seconds left"
    if seconds < 90:
        return f"about {10 * round(seconds / 10)} s left"
    return f"about {seconds / 60:.0f} min left" if seconds < 5400 else f"about {seconds / 3600:.1f} h left"
