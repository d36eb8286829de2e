"""The motion between two camera frames: what gives it, and one that nothing measured."""

from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from ...core.errors import InputError
from ...core.factors import Odometry
from ...core.se2 import Array
from .encoder import Floors


class Motion(Protocol):
    """Readings in order of time, which give the motion between any two times among them as one factor."""

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings, strictly increasing."""
        ...

    @property
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        ...

    def check(self) -> None:
        """Raises InputError for unusable readings."""
        ...

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion from `start` to `end`, s, both within the readings' time."""
        ...

    def remarks(self, start: float, end: float) -> list[str]:
        """Says what is legal yet odd in the readings from `start` to `end`, s, each without its full stop."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The source's entry in a log's notes."""
        ...


@dataclass(frozen=True)
class Drift:
    """Unmeasured motion: the robot is assumed to stand, with growing uncertainty.

    A random walk, white in velocity: the covariance does not depend on the frame rate.
    """

    position: float  # m per root second, along both body axes
    turning: float  # rad per root second
    floors: Floors = field(default_factory=Floors)

    @property
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        return "odometry"

    @property
    def t(self) -> Array:
        """(2,) all of time."""
        return np.array([-np.inf, np.inf])

    def check(self) -> None:
        """Does nothing: no readings can be wrong."""

    def remarks(self, start: float, end: float) -> list[str]:
        """Says nothing: there are no readings."""
        del start, end
        return []

    def odometry(self, start: float, end: float) -> Odometry:
        """Stands still from `start` to `end`, s."""
        growth = np.array([self.position, self.position, self.turning]) ** 2 * (end - start)
        return Odometry(np.zeros(3), np.diag(growth) + self.floors.cov)

    @property
    def settings(self) -> dict[str, Any]:
        """The growth."""
        return {"drift": asdict(self)}


def in_order(t: Array, source: str) -> None:
    """Raises InputError for no readings, and for times that do not increase."""
    if len(t) == 0:
        raise InputError(f"{source}: found no readings, expected at least one.")
    late = np.flatnonzero(~(np.diff(t) > 0))
    if len(late):
        row = int(late[0]) + 1
        raise InputError(f"{source}: reading {row} is at {t[row]} s, expected later than {t[row - 1]} s.")
