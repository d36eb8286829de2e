"""The UTIAS Multi-Robot Cooperative Localization and Mapping logs, of one robot or of several in one dataset.

K. Y. K. Leung, Y. Halpern, T. D. Barfoot and H. H. T. Liu, "The UTIAS multi-robot cooperative localization and mapping
dataset", International Journal of Robotics Research 30(8):969-974, 2011. Nine datasets of five robots that drive among
fifteen barcodes, and see each other too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.options import option
from ..registry import Member, Source
from .catalogue import fetched, place
from .mrclam_log import ALL, Options, read
from .mrclam_sets import LAST_ROBOT, MARK, SETS, USUAL, RecordedSet, set_in, sets_in


@dataclass(frozen=True)
class AllSets(Options):
    """Fills in all datasets and robots where none is named."""

    dataset: int | str | None = option(
        ALL, "number of the dataset; all: every one", minimum=1, maximum=SETS, choices=(ALL,)
    )
    robot: int | str = option(ALL, "whose log; all: every robot's", minimum=1, maximum=LAST_ROBOT, choices=(ALL,))


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """UTIAS MRCLAM: a robot among barcodes, commanded speeds; truth by Vicon, or of the map alone: mrclam[robot=1]."""
    number = options.dataset
    if isinstance(number, str) or isinstance(options.robot, str):
        raise InputError(f"dataset mrclam: found {len(many(options))} logs, expected one dataset and one robot.")
    if options.path:
        return read(set_in(Path(options.path), number), options)
    number = number or USUAL
    return read(set_in(fetched(f"mrclam-{number}", f"mrclam[dataset={number},path=FOLDER]"), number), options)


def make_all(options: AllSets, rng: np.random.Generator) -> Dataset:
    """UTIAS MRCLAM, all nine sets of five robots in one verdict, each set a cluster: mrclam-all[path=FOLDER]."""
    return make(options, rng)


def many(options: Options) -> list[Member]:
    """Lists the logs of options with an `all`; of a given folder, those that are there.

    A set is a cluster: its robots drive in one hall at the same time, under the same motion capture, among the same
    landmarks at the same places, and are in each other's way. Each set is a recording of its own. InputError for a
    folder without any.
    """
    if ALL not in (options.dataset, options.robot):
        return []
    own = {field.name: getattr(options, field.name) for field in fields(Options)}
    found = [
        Member(
            "mrclam",
            replace(Options(**own), dataset=_number(options, one), robot=robot),
            f"set {one.called}, robot {robot}",
            f"set {one.called}",
        )
        for one in _sets(options)
        for robot in _robots(options)
        if robot in one.robots or not (options.path or one.folder.is_dir())
    ]
    if not found:
        expected = f"a set, such as MRCLAM_Dataset{USUAL} with {MARK}, Robot1_Odometry.dat and so on"
        raise InputError(f"{options.path}: found no log of MRCLAM, expected {expected}.")
    return found


def absent(options: Options) -> list[str]:
    """Names the sets and robots that options with an `all` stand for and that are not there.

    They are in the given folder or, without one, fetched.
    """
    if ALL not in (options.dataset, options.robot) or not (options.path or _fetched(options)):
        return []
    found = _sets(options)
    numbers = {one.number for one in found}
    lacking = range(1, SETS + 1) if options.dataset == ALL and None not in numbers else ()
    return [f"set {number}" for number in lacking if number not in numbers] + [
        f"robot {robot} of set {one.called}" for one in found for robot in _robots(options) if robot not in one.robots
    ]


def _sets(options: Options) -> list[RecordedSet]:
    """The sets that options ask for: all, or one. Without a path those that were fetched, or else all of them."""
    if not options.path:
        return _fetched(options) or _numbered(options)
    path = Path(options.path)
    return sets_in(path) if isinstance(options.dataset, str) else [set_in(path, options.dataset)]


def _fetched(options: Options) -> list[RecordedSet]:
    return [one for one in _numbered(options) if one.folder.is_dir()]


def _numbered(options: Options) -> list[RecordedSet]:
    numbers = range(1, SETS + 1) if isinstance(options.dataset, str) else [options.dataset or USUAL]
    return [RecordedSet(number, place(f"mrclam-{number}")) for number in numbers]


def _robots(options: Options) -> Sequence[int]:
    """The robots that options ask for: all, or one."""
    return range(1, LAST_ROBOT + 1) if isinstance(options.robot, str) else [options.robot]


def _number(options: Options, one: RecordedSet) -> int | None:
    """The number in the options of one log, not given where that reads the same: a log has one name."""
    if not isinstance(options.dataset, str):
        return options.dataset
    return None if not options.path and one.number == USUAL else one.number


source = Source(make, Options, many=many, absent=absent)
all_sets = Source(make_all, AllSets, many=many, absent=absent)
