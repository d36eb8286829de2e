"""The families of mutations: each tries so many cases with a seed, and tells how each ended."""

from collections.abc import Callable, Iterator

from . import bags_of_drives, csv_logs, log_folders, plugins, records
from .ending import Ended

FAMILIES: dict[str, Callable[[int, int], Iterator[Ended]]] = {
    "csv": csv_logs.tried,
    "folders": log_folders.tried,
    "bags": bags_of_drives.tried,
    "plug-ins": plugins.tried,
    "records": records.tried,
}
