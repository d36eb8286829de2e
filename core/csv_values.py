"""Parses numbers in text files and words the errors about them."""

from collections.abc import Sequence
from math import isfinite

SHOWN = 40  # characters of a value that a message quotes
SHOWN_IN_ALL = 200  # characters of a header that a message quotes
SIX_DIGITS = 1e5  # s, from which on six digits are whole seconds or less

_SEPARATORS = {";": "found ; between the columns", "\t": "found tabs between the columns"}


def number(cell: str) -> float | None:
    """Parses a number; None if it is not one."""
    if "_" in cell or not cell.isascii():  # float() reads 1_000, and digits of every script
        return None
    try:
        return float(cell)
    except ValueError:
        return None


def finite(cell: str) -> float | None:
    """Parses a finite number; None if it is not one."""
    found = number(cell)
    return found if found is not None and isfinite(found) else None


def digits_lost(times: Sequence[float]) -> str:
    """A hint for times of which several are alike, at the end of a sentence, where %g has left six digits of each."""
    lost = max(map(abs, times), default=0.0) >= SIX_DIGITS and all(float(f"{t:.6g}") == t for t in times)
    return "; all times have six digits or fewer: perhaps %g wrote them, where %.9f keeps the others" if lost else ""


def no_number(cell: str) -> str:
    """Words the error for a `cell` that is not a number."""
    cell = cell.strip()
    if not cell:
        return "is blank, expected a number"
    decimal = " with a decimal point" if number(cell.replace(",", ".", 1)) is not None else ""
    return f"is {shortened(cell)}, expected a number{decimal}"


def shortened(text: str, most: int = SHOWN) -> str:
    """`text` in quotes, control characters escaped, truncated to `most` characters."""
    return repr(text) if len(text) <= most else f"{text[:most]!r}..."


def other_count(found: Sequence[str], columns: Sequence[str], delimiter: str | None) -> str:
    """Words the error for a row with the wrong number of cells."""
    wanted = f"{len(columns)} ({shown(columns)})"
    decimal = delimiter == "," and len(found) > len(columns) and not any("." in cell for cell in found)
    hint = "; numbers have a decimal point, these perhaps decimal commas" if decimal else ""
    return f"found {len(found)} columns, expected {wanted}{hint}"


def shown(columns: Sequence[str]) -> str:
    """Column names as a header would have them, truncated."""
    header = ",".join(columns)
    return header if header.isprintable() and len(header) <= SHOWN_IN_ALL else shortened(header, SHOWN_IN_ALL)


def other_header(line: str, columns: Sequence[str]) -> str | None:
    """Words the error for a header that has `columns` but with other separators or spelling; None if it does not."""
    if "," not in line and len(columns) > 1:
        for separator, found in _SEPARATORS.items():
            if separator in line:
                return f"{found}, expected commas"
    by_look = {_look(name): name for name in header_names(line)}
    for name in columns if all(_look(name) in by_look for name in columns) else ():
        if (found := by_look[_look(name)]) != name:
            return f"found the column {shortened(found)}, expected {name}, spelt like this"
    return None


def header_names(line: str) -> list[str]:
    """The names in a header, stripped."""
    return [cell.strip() for cell in line.split(",")]


def _look(name: str) -> str:
    """A name without case, blanks and quotes."""
    return "".join(name.replace('"', "").split()).casefold()
