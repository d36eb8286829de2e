"""An estimate with its interval."""

from typing import NamedTuple


class Estimated(NamedTuple):
    """A parameter with its 95 % interval."""

    value: float
    low: float
    high: float
