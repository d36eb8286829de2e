"""Limits that no robot's measure exceeds: a value beyond them was given in another unit."""

from collections.abc import Callable
from typing import NamedTuple

Other = tuple[str, Callable[[float], float]]
"""Another unit, and the conversion of a value from it."""


class Measure(NamedTuple):
    """A unit, the values in it that some robot has, and the units that others are usually in."""

    unit: str
    least: float
    most: float
    others: tuple[Other, ...] = ()
    usual: tuple[float, float] = (0.0, float("inf"))  # sizes by which the other unit is guessed, the last excluded

    def odd(self, value: float) -> str | None:
        """Words what is wrong with `value`: the number found, those expected, and the unit meant; None if nothing."""
        if self.least <= value <= self.most:
            return None
        meant = (
            f" ({converted:.3g} if this is in {name})"
            for name, convert in self.others
            if value and self.least <= (converted := convert(value)) <= self.most
            if self.usual[0] <= abs(converted) < self.usual[1]
        )
        return f"found {value:g}, expected {self.unit} from {self.least:g} to {self.most:g}{next(meant, '')}"


def of_units(*units: tuple[str, float]) -> tuple[Other, ...]:
    """Other units by their sizes."""
    return tuple((name, lambda value, size=size: value * size) for name, size in units)


LENGTHS = of_units(("centimetres", 1e-2), ("millimetres", 1e-3))
SECONDS = of_units(("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9))
DEGREES = of_units(("degrees", 0.017453292519943295))

SIDE = Measure("metres", 1e-4, 10.0, LENGTHS, (0.02, 1.0))
"""Of a printed marker or a square of a board."""
