"""Writes numbers with three significant digits, and an exponent only where zeros would bury them."""

import math
from collections.abc import Sequence

SMALLEST, LARGEST = 1e-5, 1e7  # sizes between which a number is written without an exponent

TIMES = "\N{MULTIPLICATION SIGN}"
_RAISED = str.maketrans("-.0123456789", "⁻·⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float) -> str:
    """Writes 0.0213, 4.50, 1,234 or 2.08×10⁷."""
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else f"{'-' * (value < 0)}∞"
    if value == 0:
        return "0"
    rounded = float(f"{value:.2e}")
    if not SMALLEST <= abs(rounded) < LARGEST:
        mantissa, _, exponent = f"{value:.2e}".partition("e")
        return f"{mantissa}{TIMES}10{raised(str(int(exponent)))}"
    if abs(rounded) >= 100:
        return f"{value:,.0f}"
    return f"{rounded:.{2 - math.floor(math.log10(abs(rounded)))}f}"


def raised(digits: str) -> str:
    """Writes an exponent, -0.5 as ⁻⁰·⁵."""
    return digits.translate(_RAISED)


def plain(value: float) -> str:
    """Writes as `number`, without trailing zeros: for the ticks of an axis."""
    text = number(value)
    return text.rstrip("0").rstrip(".") if "." in text and TIMES not in text else text


def counted(n: int, noun: str) -> str:
    """Writes 1 seed, 3 seeds."""
    return f"{n:,} {noun}" if n == 1 else f"{n:,} {noun}s"


def lasting(seconds: float) -> str:
    """Writes a duration: less than 1 s, 90 s, 10 minutes, 3 hours, 2 days."""
    for unit, many in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * many:
            return f"{seconds / many:.0f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 1 else "less than 1 s"


def listed(names: Sequence[str], most: int | None = None) -> str:
    """Joins names: a; a and b; a, b and c; of more than `most`, the first ones and how many more."""
    if most is not None and len(names) > most + 1:
        names = [*names[:most], f"{len(names) - most:,} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])}{' and ' * bool(names)}{''.join(names[-1:])}"


def times(low: float, high: float) -> str:
    """Writes an interval of ratios above 1: "1.8 to 2.3 times", "at least 1.8 times" without an upper end."""
    if math.isinf(high):
        return f"at least {factor(low)} times"
    one, other = factor(low), factor(high)
    return f"{one} times" if one == other else f"{one} to {other} times"


def factor(ratio: float) -> str:
    """Writes a ratio of 1 or more: 1.004, 1.04, 1.8, 17, 1,200."""
    if ratio < 1.1:
        return f"{ratio:.{2 if ratio >= 1.01 else 3}f}"
    return f"{ratio:.1f}" if ratio < 9.95 else f"{float(f'{ratio:.2g}'):,.0f}"


def larger(ratio: float) -> str:
    """Writes by how much a ratio of 1 or more exceeds 1: "4 %", "2.3 times", "any number of times" if infinite."""
    if math.isinf(ratio):
        return "any number of times"
    if ratio >= 1.5:
        return f"{factor(ratio)} times"
    percent = 100 * (ratio - 1)
    return f"{percent:.0f} %" if percent >= 0.95 else f"{percent:.1f} %" if percent >= 0.05 else "0 %"


def chance(p: float) -> str:
    """Writes a p value: "p = 0.0021" or "p < 0.0001"."""
    return "p < 0.0001" if p < 1e-4 else f"p = {float(f'{p:.2g}'):.4f}".rstrip("0").rstrip(".")
