"""Replaces characters that a terminal or a file cannot encode."""

import codecs
import io
import sys
import unicodedata

PLAIN = {
    "\N{MIDDLE DOT}": "|", "\N{MULTIPLICATION SIGN}": "x", "\N{EN DASH}": "-", "\N{MINUS SIGN}": "-",
    "\N{DAGGER}": "+", "\N{GREEK SMALL LETTER MU}": "u", "\N{INFINITY}": "inf", "\N{PLUS-MINUS SIGN}": "+-",
    "\N{DEGREE SIGN}": " deg", "\N{LESS-THAN OR EQUAL TO}": "<=", "\N{GREATER-THAN OR EQUAL TO}": ">=",
    "\N{RIGHT SINGLE QUOTATION MARK}": "'", "\N{EM DASH}": "-", "\N{APPROXIMATELY EQUAL TO}": "~",
}  # fmt: skip
"""Replacements; other characters lose their accents, or become a question mark."""


def plain_where_needed() -> None:
    """Makes standard output and error replace what they cannot encode, instead of raising an error."""
    codecs.register_error("slamduel-plain", _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="slamduel-plain")


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """Handles an encoding error: the replacement, and the position to go on from."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_plain, error.object[error.start : error.end])), error.end


def _plain(letter: str) -> str:
    if letter in PLAIN:
        return PLAIN[letter]
    decomposed = unicodedata.normalize("NFKD", letter)
    return "".join(PLAIN.get(c, c) for c in decomposed if c.isascii() or c in PLAIN) or "?"
