"""Reads the relations of the Freiburg benchmark, lines of `t1 t2 x y z roll pitch yaw`.

R. Kuemmerle et al., On measuring the accuracy of SLAM algorithms, Autonomous Robots 27(4), 2009: the pose at t2 as seen
from that at t1, verified by hand. Times are the stamps of scans, in s; z, roll and pitch are not used.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Truth
from ...core.relations import LONGEST_GAP, Relations
from ...core.se2 import wrap
from ...core.table import LARGEST, Table, read_spaced
from ...frontend.laser.anchors import anchors
from ...frontend.laser.front_end import FrontEnd
from ...frontend.laser.log import log_of
from ...frontend.laser.recording import LaserRecording, matched
from ...frontend.laser.settings import Settings
from ..remarks import remarked

COLUMNS = ("t1", "t2", "x", "y", "z", "roll", "pitch", "yaw")


def beside(path: Path) -> Path:
    """The file of relations of a laser log: NAME.relations beside NAME.clf or NAME.clf.gz."""
    return path.with_name(f"{path.name.partition('.')[0]}.relations")


def read_relations(path: Path) -> Table:
    """Reads the file; InputError names the line of what is invalid."""
    table = read_spaced(path, COLUMNS).finite().bounded(-LARGEST, LARGEST, "x", "y")
    if not len(table.rows):
        raise InputError(f"{path}: found no relations, expected lines of {' '.join(COLUMNS)}.")
    for row in np.flatnonzero(table.column("t1") == table.column("t2")):
        raise table.fault(row, f"t1 and t2 are both {table.column('t1')[row]!s}, expected two scans")
    return table


class Built(NamedTuple):
    """A log, and the front end that made it."""

    dataset: Dataset
    front_end: FrontEnd


def build(
    recording: LaserRecording,
    settings: Settings,
    path: Path,
    remarks: Sequence[str],
    observe: Callable[[FrontEnd], None] | None = None,
) -> Built:
    """Makes the log of a recording, with the relations beside its file `path`, if there are any.

    `remarks` are those of the recording's reader; `observe` is called after every scan.
    """
    table = read_relations(beside(path)) if os.path.lexists(beside(path)) else None
    front_end = matched(recording, settings, observe)
    log = log_of(recording, front_end)
    if table is None:
        return Built(Dataset(remarked(log, remarks), None), front_end)
    truth, odd = related(table, front_end)
    return Built(Dataset(remarked(log, [*remarks, *odd]), truth), front_end)


def related(table: Table, front_end: FrontEnd) -> tuple[Truth, list[str]]:
    """Places the relations beside the steps of a log, with remarks; those with a stamp without a scan are left out.

    InputError where none is left.
    """
    first, second = (anchors(front_end, table.column(name)) for name in ("t1", "t2"))
    kept = np.flatnonzero(first.known & second.known)
    if not len(kept):
        raise InputError(
            f"{table.path}: found {len(table.rows)} relations, all at times from {table.column('t1').min():.6f} to "
            f"{table.column('t2').max():.6f} s without scans, expected those of scans, {front_end.t[0]:.6f} to "
            f"{front_end.t[-1]:.6f} s."
        )
    remarks = list[str]()
    if len(kept) < len(table.rows):
        remarks.append(
            f"{len(table.rows) - len(kept)} of {len(table.rows)} relations are left out: they are at times before or "
            f"after the scans, or between two more than {LONGEST_GAP:g} s apart"
        )
    delta = np.stack([table.column(name)[kept] for name in ("x", "y", "yaw")], axis=-1)
    delta[:, 2] = wrap(delta[:, 2])
    ends = first.anchors.taken(kept), second.anchors.taken(kept)
    relations = Relations(*ends, delta, first.exact[kept] & second.exact[kept])
    for column in (*relations.first, *relations.second, relations.delta, relations.exact):
        column.flags.writeable = False
    nothing = np.zeros(0)
    return Truth(nothing, nothing.reshape(0, 3), kind="relations", relations=relations), remarks
