"""Scans: readers that can report every fault of a file and not only the first.

A scan is a generator. It yields each fault as an error, continues as well as it can, and returns what it has read;
where it cannot continue it raises the error. `strict` makes a reader of it that raises the first.
"""

from collections.abc import Callable, Generator
from typing import TypeVar

from .errors import InputError

T = TypeVar("T")
Scan = Generator[InputError, None, T]


def told(scan: Scan[T], tell: Callable[[InputError], None]) -> T:
    """Returns the result of `scan`; calls `tell` with each fault as it is found."""
    while True:
        try:
            fault = next(scan)
        except StopIteration as end:
            return end.value
        tell(fault)


def strict(scan: Scan[T]) -> T:
    """Returns the result of `scan`; raises its first fault."""
    return told(scan, _raise)


def _raise(fault: InputError) -> None:
    raise fault


def attempted(scan: Scan[T]) -> Scan[T | None]:
    """Yields also the error that `scan` raises where it cannot continue, and then returns None."""
    try:
        return (yield from scan)
    except InputError as error:
        fatal = error
    yield fatal
    return None


def counted(scan: Scan[T]) -> Scan[tuple[T, int]]:
    """Yields what `scan` yields; returns its result and the number of its faults."""
    faults = 0
    while True:
        try:
            fault = next(scan)
        except StopIteration as end:
            return end.value, faults
        faults += 1
        yield fault
