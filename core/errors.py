"""Root classes of the errors meant for the user, and the known name nearest to an unknown one."""

import difflib
from collections.abc import Iterable


class SlamduelError(Exception):
    """A sentence for the user: it names the file and row, or the option, what was found and what was expected.

    Caught once, at the command line, which prints it and ends with exit status 2.
    """


class InputError(SlamduelError):
    """A file, a log, an option or a combination of them that cannot be used."""


class Absent(InputError):
    """A published log that is not on this machine."""


class Interrupted(SlamduelError):
    """The user stopped a command; the message says how to resume it."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Suggests the known name that was meant, or lists all."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.55)
    if close:
        return f"did you mean {close[0]!r}?"
    return f"expected one of {', '.join(names)}." if names else "it has none."
