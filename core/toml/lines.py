"""Line numbers of a TOML file's keys, which Python's tomllib does not provide."""

import re
import tomllib
from bisect import bisect_right

Place = tuple[str | int, ...]
"""Position of a value: table keys and array indices, from the outermost."""

_KEY = re.compile(r"""[ \t]*("(?:\\.|[^"\\])*"|'[^']*'|[A-Za-z0-9_-]+)[ \t]*""")
_BLANK = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_PLAIN = re.compile(
    r'''"""(?:\\.|[^\\])*?""""{0,2}|\'\'\'.*?\'\'\''{0,2}|"(?:\\.|[^"\\])*"|'[^']*'|[^,\]}#\n]+''', re.DOTALL
)
"""A string of one of the four kinds, or a number, a date, true or false."""


def lines(text: str) -> dict[Place, int]:
    """The line, from 1, of every table, key and element; `text` must be valid TOML."""
    return _Scan(text.replace("\r\n", "\n")).lines


class _Scan:
    """One pass over the text; `at` is the current character's index."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0
        self.lines: dict[Place, int] = {}
        self.counts: dict[Place, int] = {}  # length so far of each array of tables
        self.ends = [match.start() for match in re.finditer("\n", text)]
        table: Place = ()
        while first := self._next():
            if first == "[":
                table = self._header()
            else:
                self._pair(table)

    def _header(self) -> Place:
        """Parses [table] or [[an element of an array of tables]]; returns its place."""
        many, line = self.text.startswith("[[", self.at), self._line()
        self.at += 1 + many
        place = self._named(())
        self.at += 1 + many
        if many:
            self.counts[place] = self.counts.get(place, 0) + 1
            place = (*place, self.counts[place] - 1)
            self.lines[place] = line
        return place

    def _pair(self, table: Place) -> None:
        """A key and its value."""
        place = self._named(table)
        self.at += 1  # the equals sign
        self._value(place)

    def _named(self, place: Place) -> Place:
        """The place of the next key; in an array of tables it is in the last element."""
        line = self._line()
        for part in self._key():
            if place in self.counts:
                place = (*place, self.counts[place] - 1)
            place = (*place, part)
            self.lines.setdefault(place, line)
        return place

    def _value(self, place: Place) -> None:
        first = self._next()
        if first not in ("[", "{"):
            found = _PLAIN.match(self.text, self.at)
            assert found is not None
            self.at = found.end()
            return
        self.at += 1
        count = 0
        while (found := self._next()) not in ("]", "}"):
            if found == ",":
                self.at += 1
            elif first == "{":
                self._pair(place)
            else:
                self.lines[(*place, count)] = self._line()
                self._value((*place, count))
                count += 1
        self.at += 1

    def _key(self) -> list[str]:
        """The parts of a dotted key."""
        parts: list[str] = []
        while not parts or self.text[self.at] == ".":
            found = _KEY.match(self.text, self.at + bool(parts))
            assert found is not None
            self.at = found.end()
            parts.append(tomllib.loads(f"key = {found[1]}")["key"] if found[1][0] in "\"'" else found[1])
        return parts

    def _next(self) -> str:
        """The next character that is neither blank nor in a comment, "" at the end."""
        found = _BLANK.match(self.text, self.at)
        assert found is not None
        self.at = found.end()
        return self.text[self.at : self.at + 1]

    def _line(self) -> int:
        return bisect_right(self.ends, self.at - 1) + 1
