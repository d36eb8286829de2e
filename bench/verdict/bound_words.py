"""Words on the Cramér-Rao bound of a dataset's logs, and on who comes nearest to it."""

import math
from collections.abc import Sequence

from ..words.numerals import number
from .summary import Line, units_of

ENDS = {"final_": "final", "": "online"}
"""Prefix of a path's columns -> its name, in order."""


def bound_sentence(lines: Sequence[Line]) -> str:
    """States the bounds of one dataset's errors, and whose path is nearest to each; "" without any.

    A bound is one of mean squares: so are they, and the multiples of them, over logs.
    """
    bounds, nearest = list[str](), list[str]()
    for prefix, end in ENDS.items():
        having = [line for line in lines if line.by_log(f"{prefix}bound_m") and not line.told]
        if not having:
            continue
        bounds.append(f"{number(_rms(having[0], f'{prefix}bound_m'))} m ({end})")
        whole = [line for line in having if line.by_log(f"{prefix}over_bound") and not line.failed]
        if whole:
            times = {line.backend: _rms(line, f"{prefix}over_bound") for line in whole}
            best = min(times, key=lambda name: times[name])
            nearest.append(f"{best} at {number(times[best])} times the {end} one")
    if not bounds:
        return ""
    logs = units_of(lines).logs
    said = f"No unbiased estimator ends below {' or '.join(bounds)} with noise as stated: the Cramér-Rao bound"
    said += f", root mean square over {logs} logs." if logs > 1 else "."
    return f"{said} Nearest: {', '.join(nearest)}." if nearest else said


def _rms(line: Line, column: str) -> float:
    """The root mean square of a column over logs."""
    values = line.by_log(column).values()
    return math.hypot(*values) / math.sqrt(len(values))
