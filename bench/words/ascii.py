"""Plain letters for a terminal, or a file, that has no others."""

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
"""What is written instead; others lose their accents, or become a question mark."""


def plain_where_needed() -> None:
    """From now on, what standard output and error cannot write is replaced and no error."""
    codecs.register_error("slamduel-plain", _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="slamduel-plain")


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """A handler of codecs: the replacement, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_plain, error.object[error.start : error.end])), error.end


def _plain(letter: str) -> str:
    if letter in PLAIN:
        return PLAIN[letter]
    decomposed = unicodedata.normalize("NFKD", letter)
    return "".join(PLAIN.get(c, c) for c in decomposed if c.isascii() or c in PLAIN) or "?"
