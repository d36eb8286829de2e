"""The cells of a text file: how they are read as numbers, and how a sentence tells what is wrong with them."""

from collections.abc import Sequence

SHOWN = 40
"""Characters of a cell that a sentence shows."""

SHOWN_IN_ALL = 200
"""Characters of a whole header that a sentence shows."""

_SEPARATORS = {";": "found ; between the columns", "\t": "found tabs between the columns"}


def number(cell: str) -> float | None:
    """None for what is none."""
    if "_" in cell or not cell.isascii():  # float() reads 1_000, and digits of every script
        return None
    try:
        return float(cell)
    except ValueError:
        return None


def no_number(cell: str) -> str:
    """What is said of `cell` where it is no number."""
    cell = cell.strip()
    if not cell:
        return "is blank, expected a number"
    decimal = " with a decimal point" if number(cell.replace(",", ".", 1)) is not None else ""
    return f"is {shortened(cell)}, expected a number{decimal}"


def shortened(text: str, most: int = SHOWN) -> str:
    """`text` in quotes, tabs and the like by their escapes, and of what is longer than `most` the beginning."""
    return repr(text) if len(text) <= most else f"{text[:most]!r}..."


def other_count(found: Sequence[str], columns: Sequence[str], delimiter: str | None) -> str:
    """What is said of a row whose cells `found` are not as many as the columns."""
    wanted = f"{len(columns)} ({shown(columns)})"
    decimal = delimiter == "," and len(found) > len(columns) and not any("." in cell for cell in found)
    hint = "; numbers have a decimal point: are there decimal commas?" if decimal else ""
    return f"found {len(found)} columns, expected {wanted}{hint}"


def shown(columns: Sequence[str]) -> str:
    """The names of columns, as they would stand in a header, of many the first."""
    header = ",".join(columns)
    return header if header.isprintable() and len(header) <= SHOWN_IN_ALL else shortened(header, SHOWN_IN_ALL)


def other_header(line: str, columns: Sequence[str]) -> str | None:
    """What is said of the header `line` where it has `columns`, but with other separators or in another spelling."""
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
    """The names in a header, without the blanks around them."""
    return [cell.strip() for cell in line.split(",")]


def _look(name: str) -> str:
    """What is left of a name without case, blanks and quotes."""
    return "".join(name.replace('"', "").split()).casefold()
