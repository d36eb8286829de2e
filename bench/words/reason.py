"""Writes what a backend has said so that a database, a terminal and a page can take it: one line, visible, not long."""

LONGEST = 500  # characters of a reason: six lines of a terminal
LONGEST_TRACEBACK = 20_000
CUT = " ... [cut] ... "
END = 100  # characters kept of the end of what is cut, where the line of code stands


def reason(text: str) -> str:
    """The text on one line, its invisible characters escaped, cut in the middle to LONGEST characters."""
    line = " ".join(_cut(text, 20 * LONGEST).split())  # cut first: it may have megabytes
    return _cut(_visible(line), LONGEST)


def traceback(text: str) -> str:
    """The lines of a traceback likewise, of up to LONGEST_TRACEBACK characters in all."""
    return _cut("\n".join(_visible(line) for line in _cut(text, LONGEST_TRACEBACK).split("\n")), LONGEST_TRACEBACK)


def _visible(text: str) -> str:
    """Escapes control characters, halves of surrogate pairs and the like, and the mark of what cannot be decoded."""
    kept = ((c, c.isprintable() and c != "\N{REPLACEMENT CHARACTER}") for c in text)
    return "".join(c if shown else c.encode("unicode_escape").decode("ascii") for c, shown in kept)


def _cut(text: str, most: int) -> str:
    """Leaves out the middle of a text that is longer than `most`."""
    return text if len(text) <= most else text[: most - END - len(CUT)] + CUT + text[-END:]
