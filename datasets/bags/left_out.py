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
    noun: str  # of one
    of: str  # as in "of topic /odom"
    count: int = 0
    number: int = 0  # of the first, from 1 on
    why: str = ""

    def add(self, number: int, why: str) -> None:
        """Counts message `number`."""
        if not self.count or number < self.number:
            self.number, self.why = number, why
        self.count += 1

    def remarks(self, total: int) -> list[str]:
        """The remark on those of `total`; none for none. InputError where they are more than MOST."""
        if not self.count:
            return []
        found = f"{self.where}: {self.count} of {total} {self.noun}s {self.of} cannot be used"
        first = f"the first, {self.noun} {self.number}, {self.why}"
        if self.count > MOST * total:
            raise InputError(f"{found}, expected most of them to be sound; {first}.")
        return [f"{found} and are left out; {first}"]
