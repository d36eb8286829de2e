"""Ground truth of the path and the landmarks, as files beside a recording.

truth.tum        t x y z qx qy qz qw
landmarks.csv    id,x,y[,moving]          moving: 1 if the landmark moves from that place, else 0
relations.csv    true motions between poses beside the steps of a log: see `core.relations.COLUMNS`
"""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..core.factors import Dataset, Log, Map, Truth, digest_of
from ..core.relations import COLUMNS as COLUMNS_OF_RELATIONS
from ..core.relations import LONGEST_GAP, Relations, as_rows, from_rows
from ..core.scan import Scan, attempted, strict
from ..core.se2 import Array, Ints, compose, inverse, wrap
from ..core.table import scan_csv
from ..core.truth.tum import scan_tum, write_tum
from .remarks import remarked
from .truth_remarks import COVERED

POSES = "truth.tum"
PLACES = "landmarks.csv"
RELATIONS = "relations.csv"
COLUMNS = ("id", "x", "y")
MOVING = ("moving",)
SLOWER = 100.0  # times as long as the log, from which on a truth that fits it badly is in a smaller unit of time


def read_truth(folder: Path) -> Truth | None:
    """Reads the ground truth in `folder`, None without a file of it; InputError names the file and line of a fault."""
    return strict(scan_truth(folder))


def scan_truth(folder: Path, times: Array | None = None) -> Scan[Truth | None]:
    """Scans as `read_truth` reads, without invalid rows; with `times`, poses at other times are faults."""
    path = places = relations = None
    if os.path.lexists(folder / POSES):  # a link to nothing is no missing file
        path = yield from attempted(scan_tum(folder / POSES, times))
    if os.path.lexists(folder / PLACES):
        places = yield from attempted(_scan_places(folder / PLACES))
    if os.path.lexists(folder / RELATIONS):
        relations = yield from attempted(_scan_relations(folder / RELATIONS))
    if path is None and places is None and relations is None:
        return None
    known, moving = places or (None, None)
    t, poses = path or (np.zeros(0), np.zeros((0, 3)))
    t.flags.writeable = poses.flags.writeable = False
    kind = "truth" if relations is None else "relations"
    return Truth(t, poses, known, kind=kind, moving=moving, relations=relations)


def digest(truth: Truth) -> str:
    """sha256, in hexadecimal, of the ground truth as stored in a log's folder: all but the covariance of its map."""
    known = truth.map
    columns = {
        f"kind {truth.kind}": None,
        "t": truth.t,
        "poses": truth.poses,
        "map.ids": None if known is None else known.ids,
        "map.xy": None if known is None else known.xy,
        "assigned": truth.assigned,
    }
    columns |= {} if truth.moving is None else {"moving": truth.moving}
    columns |= {} if truth.relations is None else {"relations": as_rows(truth.relations)}
    columns |= {} if truth.false_loops is None else {"false_loops": truth.false_loops}
    columns |= {} if truth.assigned_partial is None else {"assigned_partial": truth.assigned_partial}
    return digest_of(columns)


def write_truth(folder: Path, truth: Truth) -> None:
    """Writes poses, landmarks' positions and relations, if any, to `folder`; the map's covariance is left out."""
    if len(truth.t):
        write_tum(folder / POSES, truth.t, truth.poses)
    if truth.map is not None:
        with (folder / PLACES).open("w", encoding="utf-8", newline="\n") as file:
            columns: list[list[Any]] = [truth.map.ids.tolist(), *truth.map.xy.T.tolist()]
            if truth.moving is not None:
                columns.append(np.isin(truth.map.ids, truth.moving).astype(int).tolist())
            file.write(",".join(COLUMNS if truth.moving is None else COLUMNS + MOVING) + "\n")
            file.writelines(",".join(map(repr, row)) + "\n" for row in zip(*columns, strict=True))
    if truth.relations is not None:
        with (folder / RELATIONS).open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(COLUMNS_OF_RELATIONS) + "\n")
            file.writelines(",".join(map(repr, row)) + "\n" for row in as_rows(truth.relations).tolist())


def sample(truth: Truth, t: Array) -> Truth:
    """The ground truth at those of the times `t` (n,), s, that it covers.

    At its own times poses are returned bit for bit; otherwise interpolated linearly between two at most LONGEST_GAP
    apart: a robot at 0.5 m/s that turns by 1 rad/s is then 2 cm off the line, and less in shorter gaps.
    """
    if not len(truth.t):
        return truth
    after = np.clip(np.searchsorted(truth.t, t), 1, max(len(truth.t) - 1, 1)) % len(truth.t)
    before = np.maximum(after - 1, 0)
    exact = np.isin(t, truth.t)
    inside = (truth.t[0] <= t) & (t <= truth.t[-1]) & (truth.t[after] - truth.t[before] <= LONGEST_GAP)
    columns = (*truth.poses.T[:2], np.unwrap(truth.poses[:, 2]))
    poses = np.stack([np.interp(t, truth.t, column) for column in columns], axis=-1)
    poses[:, 2] = wrap(poses[:, 2])
    poses[exact] = truth.poses[np.searchsorted(truth.t, t[exact])]
    covered = exact | inside
    times, poses = t[covered], poses[covered]
    times.flags.writeable = poses.flags.writeable = False
    return truth._replace(t=times, poses=poses)


def with_truth(log: Log, truth: Truth | None, first: int = 0, start_given: bool = True) -> Dataset:
    """Joins a log and a ground truth, sampled at the log's times from step `first` on; a remark where it has none.

    Where nobody gave the start, it is that of the truth: its frame is one of many in which the log is the same. With
    fixes in the world there is one alone, and the log has its start by these.
    """
    if truth is None:
        return Dataset(log, None)
    known = sample(truth, log.t[first:])
    if len(known.t) and not start_given and log.prior.map is None and log.fixes is None:
        return Dataset(replace(log, prior=log.prior._replace(pose=start(log.t, log.delta, known))), known)
    if len(known.t) or not len(truth.t):
        return Dataset(remarked(log, other_clock(POSES, truth.t, log.t[first:], len(known.t))), known)
    found = f"{log.t[0]!s} to {log.t[-1]!s} s, those of its {len(truth.t)} are from {truth.t[0]!s} to {truth.t[-1]!s} s"
    remark = f"{POSES} has no pose at the log's times, {found}, and is not used: expected the same clock"
    return Dataset(remarked(log, [remark]), known)


def other_clock(name: str, times: Array, t: Array, known: int) -> list[str]:
    """The remark on a truth of `times` (m,), none of seconds, which is `known` at few of the log's `t` (n,)."""
    spans = [float(np.ptp(one)) for one in (times, t)]
    if known >= COVERED * len(t) or spans[0] < SLOWER * spans[1]:
        return []
    found = f"the times of {name} go on for {spans[0]:.3g} s, those of the log for {spans[1]:.3g} s"
    return [f"{found}: perhaps they are in milliseconds or nanoseconds"]


def start(t: Array, delta: Array, truth: Truth) -> Array:
    """The pose (3,) from which the odometry, `delta` (n, 3) up to the times `t` (n,), leads to the first true one."""
    moved = np.zeros(3)
    for motion in delta[1 : int(np.searchsorted(t, truth.t[0])) + 1]:
        moved = compose(moved, motion)
    pose = compose(truth.poses[0], inverse(moved))
    pose.flags.writeable = False
    return pose


def _scan_places(path: Path) -> Scan[tuple[Map, Ints | None]]:
    """The landmarks, and the ids of those that move, where the file says so."""
    table = yield from scan_csv(path, COLUMNS, MOVING)
    told = table.columns[-1:] == MOVING
    table = yield from table.scan_finite()
    table = (yield from table.scan_whole("id")).sound()
    if told:
        flag = table.column("moving")
        odd = (flag != 0) & (flag != 1)
        table = (yield from table.refuse(odd, lambda row: f"moving is {flag[row]!s}, expected 0 or 1")).sound()
    names = table.column("id")
    _, first = np.unique(names, return_index=True)
    twice = np.isin(np.arange(len(names)), first, invert=True)
    table = (yield from table.refuse(twice, lambda row: f"id {names[row]:.0f} occurs twice, expected once")).sound()
    ids, xy = table.whole("id"), table.rows[:, 1:3].copy()
    moving = ids[table.column("moving") == 1] if told else ids[:0]
    ids.flags.writeable = xy.flags.writeable = moving.flags.writeable = False
    return Map(ids, xy, None), moving if told else None


def _scan_relations(path: Path) -> Scan[Relations]:
    table = yield from scan_csv(path, COLUMNS_OF_RELATIONS)
    table = yield from table.scan_finite()
    table = (yield from table.scan_whole("first", "second", "exact")).sound()
    for end in ("first", "second"):
        step, share = table.column(end), table.column(f"{end}_share")
        negative, outside = f"{end} is {{:.0f}}, expected a step, 0 or above", f"{end}_share is {{!s}}, expected 0 to 1"
        for odd, column, message in ((step < 0, step, negative), ((share < 0) | (share > 1), share, outside)):
            table = yield from table.refuse(odd, lambda row, it=column, said=message: said.format(it[row]))
    table = table.sound()
    rows = table.rows[:, : len(COLUMNS_OF_RELATIONS)].copy()
    rows.flags.writeable = False
    return from_rows(rows)
