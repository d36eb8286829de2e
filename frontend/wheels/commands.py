"""Commands to a robot's motors as odometry: each speed is held until the next one.

A robot follows its commands late, and by the wheels' size, load and slip only roughly: these are the noise.
"""

from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from .held import Held, way
from .track import TrackNoise
from .units import fast_turns

FOLLOWED = TrackNoise(forward=0.1, turning=0.2, turning_by_turn=0.3)
"""Default noise. Of a rover without encoders, whose motors turn as their loads let them, `bench noise` measured 0.07
forward and, from the turns that were commanded, 0.24 and 0.40."""


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
class Commanded(Held):
    """The way that a robot drives which follows its commands."""

    sudden: bool = True
    commands: Commands = field(default_factory=Commands)

    @classmethod
    def by(cls, given: Speeds, commands: Commands, max_speed: float, source: str) -> "Commanded":
        """The way by the speeds that were `given`. InputError where it is unknown or endless."""
        rates = commands.rates(given, source)
        t, poses, rows = way(given.t, rates, source)
        return cls(
            t + commands.delay,
            poses,
            commands.noise,
            max_speed,
            source,
            rates=rates,
            rows=rows,
            commands=commands,
        )

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
