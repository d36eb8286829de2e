"""Options of backends and datasets: frozen dataclasses whose fields carry their own help and range.

    @dataclass(frozen=True)
    class Options:
        particles: int = option(100, "number of particles", minimum=1)

The command line's `fastslam[particles=1000]`, its help and its error messages derive from these fields alone.
"""

import re
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class NoOptions:
    """No options."""


def option(
    default: Any,
    summary: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] | None = None,
    beside: str | tuple[str, ...] | None = None,
    parted: str | None = None,
    pointless: bool = False,
) -> Any:
    """Declares an option as a dataclass field with its help text `summary` (with its unit) and range or choices.

    `minimum` and `maximum` are inclusive. The field's annotation determines its parser: int, float, bool or str, or one
    of these `| None`, where None stands for "not given"; of `float | tuple[float, float]` a number or two, as in 1,2. A
    dataset's option has no effect without that named `beside`, or one of those, and is refused where none of them is
    given. A str that is a list has the separator `parted`, with which labels write it; commas are read in any list, see
    `parts`. Labels write a whole float as 20, not 20.0, where it is `pointless`: a label is part of a result's key, so
    those of older options stay.
    """
    metadata = {"summary": summary, "minimum": minimum, "maximum": maximum, "choices": choices, "beside": beside}
    return field(default=default, metadata=metadata | {"parted": parted, "pointless": pointless})


def parts(text: str) -> list[str]:
    """The parts of a list in an option: separated by commas, or by the separators of labels, ; and +."""
    return [part.strip() for part in re.split("[,;+]", text)]
