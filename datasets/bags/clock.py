"""The clock of a topic: stamps that no message of it can have, and clocks that go back."""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array, Ints
from .bag import Bag, Topic

BACK = 1.0
"""s that stamps may go back from one message to the next: messages overtake each other, but no clock is set back."""

DAY = 86_400 * 10**9
"""ns; what is farther from all other messages of a topic is of no drive: a clock that was not set yet, or garbage."""

MINUTE = 60 * 10**9
"""ns; by what both a stamp and its distance from the time of reception may differ from those of the messages around."""

AROUND = 11  # messages, of which the median says where the clock is

SINGLE = 5
"""Messages in a row whose stamps may be out of order and are left out: of more, the clock was set."""

Stamps = Sequence[int]


def astray(stamps: Stamps, received: Stamps) -> dict[int, str]:
    """The rows of `stamps`, ns in order of reception, that are not of the others' clock, and why not.

    They are a day away from the others; or at most SINGLE messages in a row are a minute away from those around, and
    from where their times of reception have them; or they go forth or back by more than `BACK`, after which the clock
    goes on as before. `received` are the times of reception, ns.
    """
    t, at = np.array(stamps, float), np.array(received, float)  # exact to 256 ns since 1970
    odd = _days_away(t)
    rest = np.flatnonzero(~odd)
    odd[rest[_minutes_away(t[rest], at[rest])]] = True
    rest = np.flatnonzero(~odd)
    odd[rest[_out_of_order(t[rest], at[rest])]] = True
    sound = np.flatnonzero(~odd)
    return {int(row): _why(t, int(row), sound) for row in np.flatnonzero(odd)}


def check_clock(bag: Bag, topic: Topic, numbers: Sequence[int], stamps: Stamps, back: float = BACK) -> None:
    """Raises InputError if a message is more than `back` s earlier than the one before; `numbers` are theirs."""
    gone = -np.diff(np.array(stamps, float))
    for row in (np.flatnonzero(gone > back * 1e9) + 1).tolist():
        raise InputError(
            f"{bag.path}: message {numbers[row]} of topic {topic.name} is at {stamps[row] / 1e9} s, "
            f"{gone[row - 1] / 1e9:.6g} s before the message received before it; expected one clock that goes forward."
        )


def _days_away(t: Array) -> NDArray[np.bool_]:
    """(n,) which of the stamps are not among the most that lie less than a day apart."""
    order = np.argsort(t, kind="stable")
    group = np.cumsum(np.diff(t[order], prepend=t[order[:1]]) > DAY)
    away = np.zeros(len(t), np.bool_)
    if len(t) > 2:
        away[order] = group != np.bincount(group).argmax()
    return away


def _minutes_away(t: Array, received: Array) -> NDArray[np.bool_]:
    """(n,) which stamps differ from those around, as do their distances from the times of reception."""
    behind = t - received
    odd = np.zeros(len(t), np.bool_)
    if len(t) < AROUND or (np.abs(np.diff(behind)) <= MINUTE).all():
        return odd
    half = AROUND // 2
    first = np.clip(np.arange(len(t)) - half, 0, len(t) - AROUND)
    around = first[:, None] + np.arange(AROUND)
    odd = np.all([np.abs(one - np.median(one[around], axis=1)) > MINUTE for one in (t, behind)], axis=0)
    return odd if _longest(odd) <= SINGLE else np.zeros(len(t), np.bool_)


def _longest(odd: NDArray[np.bool_]) -> int:
    """The most True in a row."""
    edges = np.flatnonzero(np.diff(odd, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _out_of_order(t: Array, received: Array) -> NDArray[np.bool_]:
    """(n,) which stamps to leave out so that the others do not go back; none where the clock was set."""
    odd = np.zeros(len(t), np.bool_)
    if not len(t) or (np.maximum.accumulate(t) - t).max() <= BACK * 1e9:
        return odd
    kept = _in_order(t.tolist())
    odd[:] = True
    odd[kept] = False
    place = np.searchsorted(kept, np.arange(len(t)))  # of the next one that is kept
    before = t[np.array(kept)[np.maximum(place - 1, 0)]]
    after = t[np.array(kept)[np.minimum(place, len(kept) - 1)]]
    near = (t >= np.minimum(before, after) - BACK * 1e9) & (t <= np.maximum(before, after) + BACK * 1e9)
    odd &= ~near  # messages that overtook another
    edges = np.flatnonzero(np.diff(odd, prepend=False, append=False))
    behind = t - received
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        many = end - first > SINGLE
        if many or (first > 0 and end < len(t) and _was_set(behind[:first], behind[end:])):
            odd[:] = False
            break
    return odd


def _was_set(before: Array, after: Array) -> bool:
    """Tells if stamps less times of reception, ns, are different before and after."""
    return bool(abs(np.median(before[-SINGLE:]) - np.median(after[:SINGLE])) > BACK * 1e9)


def _in_order(t: Sequence[float]) -> list[int]:
    """The rows of the longest subsequence of `t` that never decreases (patience sorting)."""
    ends, rows, before = list[float](), list[int](), list[int]()
    for row, stamp in enumerate(t):
        place = bisect_right(ends, stamp)
        before.append(rows[place - 1] if place else -1)
        if place == len(ends):
            ends.append(stamp)
            rows.append(row)
        else:
            ends[place], rows[place] = stamp, row
    found, row = list[int](), rows[-1]
    while row >= 0:
        found.append(row)
        row = before[row]
    return found[::-1]


def _why(t: Array, row: int, sound: Ints) -> str:
    """The fault of a stamp beside that of the nearest message whose stamp is sound."""
    other = int(sound[np.abs(sound - row).argmin()])
    return f"is stamped {t[row] / 1e9:.10g} s, {'after' if other < row else 'before'} one of {t[other] / 1e9:.10g} s"
