"""Words on the Cramér-Rao bound of a dataset's logs, and on who comes nearest to it."""

import math
from collections.abc import Sequence

from ..words.numerals import number
from .summary import Line

ENDS = {"final_": "final", "": "online"}
"""Prefix of a path's columns -> its name, in order."""

ROUNDED = 0.995  # times, from which on 1.00 is written
BELOW = " Below 1 is chance on these logs, or a bias that makes an error smaller."


def bound_sentence(lines: Sequence[Line]) -> str:
    """States the bounds of one dataset's errors, and whose path is nearest to each, or why there is none.

    A bound is one of mean squares: so are they, and the multiples of them, over logs.
    """
    bounds, nearest, below = list[str](), list[str](), False
    for prefix, end in ENDS.items():
        having = [line for line in lines if line.by_log(f"{prefix}bound_m") and not line.told]
        if not having:
            continue
        bounds.append(f"{number(_rms(having[0], f'{prefix}bound_m'))} m ({end})")
        whole = [line for line in having if line.by_log(f"{prefix}over_bound") and not line.failed]
        if whole:
            times = {line.backend: _rms(line, f"{prefix}over_bound") for line in whole}
            best = min(times, key=lambda name: times[name])
            below |= times[best] < ROUNDED
            nearest.append(f"{best} at {number(times[best])} times the {end} one")
    if not bounds:
        reasons = dict.fromkeys(said for line in lines for row in line.rows if (said := row.columns.get("no_bound")))
        return f"No Cramér-Rao bound: {'; '.join(reasons)}." if reasons else ""
    logs = max(len(line.by_log(f"{prefix}bound_m")) for line in lines for prefix in ENDS)
    said = f"No unbiased estimator ends below {' or '.join(bounds)} with noise as stated: the Cramér-Rao bound"
    said += f", root mean square over {logs} logs." if logs > 1 else "."
    if not nearest:
        return said
    return f"{said} Nearest: {', '.join(nearest)}.{BELOW if below else ''}"


def _rms(line: Line, column: str) -> float:
    """The root mean square of a column over logs."""
    values = line.by_log(column).values()
    return math.hypot(*values) / math.sqrt(len(values))
