"""Lines of files that rows of a log are made of."""

from typing import NamedTuple

from .se2 import Ints


class Lines(NamedTuple):
    """The lines of a file that rows of a log are made of, the first and the last one of each."""

    path: str
    first: Ints  # (n,) counted from 1
    last: Ints  # (n,)

    def words(self, row: int) -> str:
        """The file and the lines of a row."""
        first, last = int(self.first[row]), int(self.last[row])
        return f"{self.path}, line {first}" if first == last else f"{self.path}, lines {first} to {last}"
