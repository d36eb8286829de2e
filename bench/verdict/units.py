"""The units of a dataset's statistics: single logs, or clusters of logs that are not independent of each other.

Logs of one cluster share a run, a robot or a building. Where a dataset has several clusters, intervals and tests are
over clusters, each of which counts once, and what they say holds for clusters like these. Where all logs are of one
cluster they are the units, as what they share is the same for all of them: what is said then holds within that cluster.
"""

from collections.abc import Hashable, Mapping
from typing import NamedTuple

from ..words.numerals import counted


class Units(NamedTuple):
    """The units of some logs; a log that is not in `of` is a unit by itself."""

    of: Mapping[Hashable, Hashable] = {}  # by log
    within: str = ""  # the one cluster that all logs are of; "" where there are several, or none is stated

    def unit(self, log: Hashable) -> Hashable:
        """The unit of a log."""
        return self.of.get(log, log)

    @property
    def n(self) -> int:
        """Counts the units."""
        return len(set(self.of.values()))

    @property
    def logs(self) -> int:
        """Counts the logs."""
        return len(self.of)

    @property
    def noun(self) -> str:
        """Returns what a unit is: a cluster, or a log where each is one by itself."""
        return "cluster" if self.n < self.logs else "log"

    @property
    def scope(self) -> str:
        """Says in a sentence for what the statistics hold; "" where no cluster is stated."""
        if self.within:
            return (
                f"All {self.logs} logs are of one cluster, {self.within}: what is said holds for logs of "
                f"{self.within}, and nothing is claimed of others."
            )
        if self.n == self.logs:
            return ""
        return (
            "Logs of one cluster are not independent of each other: intervals and tests are over the "
            f"{self.n} clusters, and hold for clusters like these."
        )

    def at_least(self, number: int) -> str:
        """Writes 6 clusters at least, or 6 at least where units are logs."""
        return f"{number}{' clusters' * (self.noun == 'cluster')} at least"

    def __str__(self) -> str:
        return logs_in(self.logs, self.n) + f" of {self.within}" * bool(self.within)


INDEPENDENT = Units()


def units(clusters: Mapping[Hashable, str | None]) -> Units:
    """Finds the units of logs from the cluster that each is stated to be of; None, or "": none."""
    stated = {cluster or None for cluster in clusters.values()}
    if stated == {None} or len(stated) < 2:
        within = next(iter(stated), None) if len(clusters) > 1 else None
        return Units({log: log for log in clusters}, within or "")
    return Units({log: ("cluster", cluster) if cluster else log for log, cluster in clusters.items()})


def logs_in(logs: int, units: int) -> str:
    """Writes 45 logs in 9 clusters, or 45 logs where each is a unit."""
    return counted(logs, "log") + f" in {counted(units, 'cluster')}" * (units < logs)
