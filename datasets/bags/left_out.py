"""Messages that cannot be used: left out and counted where they are few, refused where they are most of their topic.

A bag cannot be edited by hand, and drivers send single messages with NaN, or without contents, as they start. Up to
half of a topic's messages it is clear which ones are the exceptions, and what is left out is a gap in time, which
readers know how to bridge; beyond, it is not.
"""

from dataclasses import dataclass

from ...core.errors import InputError

MOST = 0.5  # share of a topic's messages that may be left out


@dataclass
class LeftOut:
    """Those of one topic, or transform, and what is wrong with the first."""

    where: str  # the bag
    what: str  # as in "messages of topic /odom"
    count: int = 0
    first: str = ""

    def add(self, why: str) -> None:
        """Counts one."""
        self.count, self.first = self.count + 1, self.first or why

    def remarks(self, total: int) -> list[str]:
        """The remark on those of `total`; none for none. InputError where they are more than MOST."""
        if not self.count:
            return []
        found = f"{self.where}: {self.count} of {total} {self.what} cannot be used"
        if self.count > MOST * total:
            raise InputError(f"{found}, expected at most half of them; the first: {self.first}.")
        return [f"{found} and are left out, the first: {self.first}"]
