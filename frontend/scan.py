"""Reading that can name every fault of a file and not only the first, with one copy of the rules.

A scan is a generator. It yields each fault as the error that says it, goes on as well as it can, and returns what it
has read; where it cannot go on it raises the error. A reader is a scan that nobody lets go on: `strict`.
"""

from collections.abc import Generator
from typing import TypeVar

from .errors import InputError

T = TypeVar("T")
Scan = Generator[InputError, None, T]


def strict(scan: Scan[T]) -> T:
    """What `scan` returns; its first fault, if it has one, is raised."""
    try:
        raise next(scan)
    except StopIteration as end:
        return end.value


def attempted(scan: Scan[T]) -> Scan[T | None]:
    """What `scan` yields, and also what it raises where it cannot go on: it then returns None."""
    try:
        return (yield from scan)
    except InputError as error:
        fatal = error
    yield fatal
    return None


def counted(scan: Scan[T]) -> Scan[tuple[T, int]]:
    """What `scan` yields; what it returns, and the number of its faults."""
    faults = 0
    while True:
        try:
            fault = next(scan)
        except StopIteration as end:
            return end.value, faults
        faults += 1
        yield fault
