"""Delays of a gyro, a scanner and a depth camera, as reader and front ends of a recording found them by turns.

A log has no readings or scans that could be compared again at another delay: what was found is in its notes.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ...core.factors import Log
from ...datasets.inertial.open import CLOCK
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
    off: str = ""  # what takes it off, where it is no accident

    @property
    def sentence(self) -> str:
        """Says it."""
        if self.late is None:
            return f"No delay of the {self.sensor} is known: its turns beside those of gyro or wheels do not tell it."
        takes = f": {self.off} takes that off, and puts its turns into the log" if self.off else ""
        ms, sd = number(1e3 * self.late.value), number(1e3 * self.sd)
        return f"By the turns of the {self.by} the stamps of the {self.sensor} are {ms} ± {sd} ms late{takes}."


def told_delays(log: Log) -> Iterator[ToldDelay]:
    """Yields one for the gyro, if its turns tell it, and for each of these sensors that the log has beside others."""
    if isinstance(clock := log.notes.get(CLOCK), dict):
        yield _told("gyro", clock)
    for sensor in SENSORS:
        notes = log.notes.get(sensor)
        if not isinstance(notes, dict) or "motions" not in notes:
            continue
        late = notes.get("late")
        if late is None:
            yield ToldDelay(sensor, "", None)
            continue
        yield _told(sensor, late)


def _told(sensor: str, late: Mapping[str, Any]) -> ToldDelay:
    value, sd = float(late["seconds"]), float(late["sd"])
    found = Estimated(value, value - MARGIN * sd, value + MARGIN * sd)
    return ToldDelay(sensor, str(late["by"]), found, sd, str(late.get("off", "")))
