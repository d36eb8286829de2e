"""Names of datasets and their builders, imported on demand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.factors import Dataset
from ..core.options import NoOptions, option
from . import redrawn


class Member(NamedTuple):
    """One log of a dataset of many."""

    dataset: str  # the name of the dataset that makes it
    options: Any  # of that dataset, for this log alone
    name: str  # tells it from the others
    cluster: str | None  # logs that share a run, a robot or a building; None: independent of all others
    seed: int = 0  # that it is made with, where the dataset draws it


@dataclass(frozen=True)
class Source:
    """Makes a dataset, and declares its properties to the runner.

    `make(options, rng)` returns the log and, if there is one, its ground truth; `options` is a frozen dataclass made
    with `option(...)` fields. `seeded`: it draws from `rng`, so there is one log per seed. `costly`: it is expensive
    enough for the user's cache; `files(options)` are those that it reads. `portable`: its log is the same to the last
    bit on every x86-64 machine. `many(options)` are the logs of options that stand for several, else none, and
    `absent(options)` names those that such options stand for, too, but that are not there.
    """

    make: Callable[[Any, np.random.Generator], Dataset]
    options: type = NoOptions
    seeded: bool = False
    costly: bool = False
    portable: bool = True
    files: Callable[[Any], Sequence[Path]] = field(default=lambda _: ())
    many: Callable[[Any], Sequence[Member]] = field(default=lambda _: ())
    absent: Callable[[Any], Sequence[str]] = field(default=lambda _: ())

    def draws(self, options: Any) -> bool:
        """True if each seed is another log with these options."""
        return self.seeded or redrawn.draws(options)

    @property
    def summary(self) -> str:
        """The first line of the maker's docstring."""
        return (self.make.__doc__ or "").strip().partition("\n")[0]


@dataclass(frozen=True, kw_only=True)
class Named:
    """A name for a log that is read from files; the options of a dataset inherit it."""

    name: str | None = option(
        None, "the log's name in tables, figures and file names; not given: that of its folder or file"
    )


BUILTIN = {
    "aces": ".published.laser_logs:aces",
    "aruco-robot": ".worlds.aruco_robot:source",
    "aruco-room": ".worlds.aruco_room:source",
    "bailey": ".worlds.bailey:source",
    "carmen": ".formats.carmen:source",
    "circle": ".worlds.circle:source",
    "city": ".worlds.city:source",
    "city-trees10000": ".published.isam_worlds:city_trees10000",
    "city10000": ".published.isam_worlds:city10000",
    "city10000-ambiguous": ".published.gtsam_worlds:city10000_ambiguous",
    "csv": ".tables.csv_tables:source",
    "depth-room": ".worlds.depth_room:source",
    "dlr": ".published.dlr:source",
    "fr079": ".published.laser_logs:fr079",
    "freiburg": ".published.freiburg:source",
    "g2o": ".formats.g2o:source",
    "goats": ".beacons.goats:source",
    "gtsam": ".formats.gtsam_text:source",
    "intel-lab": ".published.laser_logs:intel_lab",
    "jrl": ".graphs.jrl:source",
    "killian": ".published.laser_logs:killian",
    "laser-all": ".published.laser_logs:all_buildings",
    "laser-floor": ".worlds.laser_floor:source",
    "linear": ".worlds.linear:source",
    "log": ".formats.log_folder:source",
    "logs": ".formats.log_list:source",
    "lost-in-the-woods": ".published.lost_in_the_woods:source",
    "manhattan": ".published.isam_worlds:manhattan",
    "matlab-report": ".worlds.matlab_report:source",
    "mit-csail": ".published.laser_logs:mit_csail",
    "mrclam": ".published.mrclam:source",
    "mrclam-all": ".published.mrclam:all_sets",
    "patrol": ".patrol.patrol:source",
    "plaza": ".beacons.plaza:source",
    "pyfg": ".graphs.pyfg:source",
    "recording": ".recordings.any_recording:source",
    "toro": ".formats.toro:source",
    "tum-pioneer-360": ".published.tum_pioneer:pioneer_360",
    "tum-pioneer-slam": ".published.tum_pioneer:pioneer_slam",
    "tum-pioneer-slam2": ".published.tum_pioneer:pioneer_slam2",
    "tum-pioneer-slam3": ".published.tum_pioneer:pioneer_slam3",
    "victoria-park": ".published.victoria_park:source",
    "victoria-park-raw": ".published.victoria_park_raw:source",
    "w10000": ".published.gtsam_worlds:w10000",
    "w20000": ".published.gtsam_worlds:w20000",
    "world": ".own_worlds.world:source",
}
"""Name -> module of this package and the `Source` in it."""


def module(name: str) -> str:
    """The full name of the module that has the source of that name; KeyError for an unknown name."""
    return f"{__package__}{BUILTIN[name].partition(':')[0]}"


def find(name: str) -> Source:
    """The source of that name; KeyError for an unknown name."""
    return getattr(import_module(module(name)), BUILTIN[name].partition(":")[2])


def seeded(name: str, given: str = "") -> bool:
    """True if each seed of that dataset, with the options `given` as text, is another log; False if it is unknown."""
    return name in BUILTIN and (find(name).seeded or redrawn.DRAWN in given.split(","))


def drawable(name: str) -> bool:
    """True if the noise of that dataset can be drawn anew; False for an unknown name."""
    return name in BUILTIN and issubclass(find(name).options, redrawn.Drawn)
