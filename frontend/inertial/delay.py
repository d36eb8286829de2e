"""The delay of a sensor's stamps."""

from typing import NamedTuple

SURE, LEAST = 4.0, 0.01  # standard deviations, and s, beyond both of which a delay is a remark


class Delay(NamedTuple):
    """The time by which stamps are late."""

    seconds: float
    sd: float

    @property
    def odd(self) -> bool:
        """True where it is no accident."""
        return abs(self.seconds) > max(SURE * self.sd, LEAST)

    @property
    def word(self) -> str:
        """Late or early."""
        return "late" if self.seconds > 0 else "early"
