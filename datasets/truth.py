"""Where a robot was and its landmarks are, as files beside what it recorded.

truth.tum        t x y z qx qy qz qw
landmarks.csv    id,x,y
"""

from pathlib import Path

import numpy as np

from ..frontend.factors import Map, Truth
from ..frontend.se2 import Array, wrap
from ..frontend.table import read_csv
from ..frontend.tum import read_tum, write_tum

POSES = "truth.tum"
PLACES = "landmarks.csv"
COLUMNS = ("id", "x", "y")

LONGEST_GAP = 0.5
"""s; between two true poses farther apart in time than this, nobody knows where the robot was."""


def read_truth(folder: Path) -> Truth | None:
    """The truth in `folder`, None where there is no file of it; InputError names the file and line of a fault."""
    poses_file, map_file = folder / POSES, folder / PLACES
    if not poses_file.exists() and not map_file.exists():
        return None
    t, poses = read_tum(poses_file) if poses_file.exists() else (np.zeros(0), np.zeros((0, 3)))
    known = _places(map_file) if map_file.exists() else None
    t.flags.writeable = poses.flags.writeable = False
    return Truth(t, poses, known, None, "truth")


def write_truth(folder: Path, truth: Truth) -> None:
    """Write the poses and the landmarks' places, where there are any, to `folder`; their covariance is left out."""
    if len(truth.t):
        write_tum(folder / POSES, truth.t, truth.poses)
    if truth.map is not None:
        with (folder / PLACES).open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(COLUMNS) + "\n")
            places = zip(truth.map.ids.tolist(), *truth.map.xy.T.tolist(), strict=True)
            file.writelines(f"{name},{x!r},{y!r}\n" for name, x, y in places)


def sample(truth: Truth, t: Array) -> Truth:
    """The truth at those of the times `t` (n,), s, that it covers.

    At a time it has, that pose, bit for bit; elsewhere on the straight line between two that are LONGEST_GAP apart at
    most: a robot at 0.5 m/s that turns by 1 rad/s is then 2 cm off the line, and off by less the shorter the gap.
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


def _places(path: Path) -> Map:
    table = read_csv(path, COLUMNS).finite()
    ids, xy = table.whole("id"), table.rows[:, 1:].copy()
    _, first = np.unique(ids, return_index=True)
    for row in np.setdiff1d(np.arange(len(ids)), first):
        raise table.fault(row, f"id {ids[row]} is there twice, expected once")
    ids.flags.writeable = xy.flags.writeable = False
    return Map(ids, xy, None)
