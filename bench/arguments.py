"""What the commands' options are read with; each raises argparse's own error."""

from argparse import ArgumentTypeError


def seed(text: str) -> int:
    """A whole number, at least 0."""
    return _whole(text, 0)


def count(text: str) -> int:
    """A whole number, at least 1."""
    return _whole(text, 1)


def positive(text: str) -> float:
    """A number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise ArgumentTypeError(f"found {text}, expected a number above 0")
    return value


def _whole(text: str, least: int) -> int:
    if not (text.isascii() and text.isdigit() and int(text) >= least):
        raise ArgumentTypeError(f"found {text}, expected a whole number, at least {least}")
    return int(text)
