"""Delays of a scanner and a depth camera, as the front ends of a joined recording found them by the gyro or the wheels.

A log has no scans that could be matched again at another delay: what its front ends found is in its notes.
"""

from collections.abc import Iterator
from typing import NamedTuple

from ...core.factors import Log
from ..words.numerals import number
from .estimated import Estimated

SENSORS = ("laser", "depth")
MARGIN = 1.96  # standard deviations of a 95 % interval


class ToldDelay(NamedTuple):
    """By how much the stamps of a sensor are late, if its turns tell it."""

    sensor: str
    by: str  # whose turns it is measured by; "" where nothing tells it
    late: Estimated | None  # s
    sd: float = 0.0  # s

    @property
    def sentence(self) -> str:
        """Says it."""
        if self.late is None:
            return f"No delay of the {self.sensor} is known: its turns beside those of gyro or wheels do not tell it."
        ms, sd = number(1e3 * self.late.value), number(1e3 * self.sd)
        return f"By the turns of the {self.by} the stamps of the {self.sensor} are {ms} ± {sd} ms late."


def told_delays(log: Log) -> Iterator[ToldDelay]:
    """Yields one for each of these sensors that the log has beside others."""
    for sensor in SENSORS:
        notes = log.notes.get(sensor)
        if not isinstance(notes, dict) or "motions" not in notes:
            continue
        late = notes.get("late")
        if late is None:
            yield ToldDelay(sensor, "", None)
            continue
        value, sd = float(late["seconds"]), float(late["sd"])
        yield ToldDelay(sensor, str(late["by"]), Estimated(value, value - MARGIN * sd, value + MARGIN * sd), sd)
