"""Commands to a robot's motors as odometry: each speed is held until the next one.

A robot follows its commands late, and by the wheels' size, load and slip only roughly: these are the noise.
"""

from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, Ints, summed
from .encoder import roll
from .holes import Holes, find_holes
from .track import Track, TrackNoise
from .units import fast_turns

FOLLOWED = TrackNoise(forward=0.1, turning=0.2, turning_by_turn=0.3)
"""Default noise. Of a rover without encoders, whose motors turn as their loads let them, `bench noise` measured 0.07
forward and, from the turns that were commanded, 0.24 and 0.40."""

LARGEST_TURN = 0.1
"""rad between two poses of the way; a straight line between these is at most 1.3 % of it off the arc."""

MOST_POSES = 1_000_000
"""More turns are of rates in other units, or of times that are."""


class Speeds(NamedTuple):
    """Commanded speeds."""

    t: Array  # (m,) s, strictly increasing
    speeds: Array  # (m, 2) m/s and rad/s, held until the next row; of wheels: left and right, shares of `full`
    wheels: bool = False


@dataclass(frozen=True)
class Commands:
    """A robot that follows commands."""

    full: float = 1.0  # m/s of a wheel that is commanded 1
    base: float | None = None  # m between the wheels; None: commands are no wheels'
    delay: float = 0.0  # s after which a command acts
    noise: TrackNoise = field(default=FOLLOWED)

    def rates(self, given: Speeds, source: str) -> Array:
        """(m, 2) m/s and rad/s. InputError for wheels an unknown way apart."""
        if not given.wheels:
            return given.speeds
        if self.base is None:
            raise InputError(
                f"{source}: found speeds of the left and right wheel, expected base, m between them, under [commands] "
                "in robot.toml."
            )
        left, right = self.full * given.speeds.T
        return np.column_stack(((left + right) / 2, (right - left) / self.base))


@dataclass(frozen=True, eq=False)
class Commanded(Track):
    """The way that a robot drives which follows its commands, as a track whose sum is lost where commands are."""

    commands: Commands = field(default_factory=Commands)
    rates: Array = field(default_factory=lambda: np.zeros((0, 2)))  # (m, 2) m/s and rad/s
    rows: Ints = field(default_factory=lambda: np.zeros(0, np.int64))  # (m,) the poses at the times of commands

    @classmethod
    def by(cls, given: Speeds, commands: Commands, max_speed: float, source: str) -> "Commanded":
        """The way by the speeds that were `given`. InputError where it is unknown or endless."""
        rates = commands.rates(given, source)
        pieces = np.maximum(np.ceil(np.abs(rates[:-1, 1]) * np.diff(given.t) / LARGEST_TURN), 1)
        if not pieces.sum() < MOST_POSES:
            turned = pieces.sum() * LARGEST_TURN
            raise InputError(f"{source}: the robot turns by {turned:.4g} rad in all, expected rad/s, s and m/s.")
        rows = np.concatenate(([0], np.cumsum(pieces))).astype(np.int64)
        t = np.interp(np.arange(rows[-1] + 1), rows, given.t)
        held = rates[np.searchsorted(rows, np.arange(len(t)), "right") - 1]
        return cls(
            t + commands.delay,
            driven(t, held),
            commands.noise,
            max_speed,
            source,
            bridged=False,
            commands=commands,
            rates=rates,
            rows=rows,
        )

    @cached_property
    def holes(self) -> Holes:
        """The times without commands."""
        return find_holes(self.t[self.rows], lambda rows: self._moved(self.rows[rows]))

    @property
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        return "commands"

    def remarks(self, start: float, end: float) -> list[str]:
        """Says where commands are missing between `start` and `end`, s, and what may be in other units."""
        return [*super().remarks(start, end), *fast_turns(self.source, self.rates[:, 1])]

    @property
    def settings(self) -> dict[str, Any]:
        """The commands and their noise."""
        return {"commands": {name: value for name, value in asdict(self.commands).items() if value is not None}}


def driven(t: Array, rates: Array) -> Array:
    """(m, 3) the poses at `t` (m,), s, of a robot that holds each of `rates` (m, 2), m/s and rad/s, until the next.

    It starts at the origin and drives arcs.
    """
    return summed(np.zeros(3), roll(rates[:-1] * np.diff(t)[:, None], "arc")[0])
