"""Reads tags that another program found in a camera's frames, from a CSV file: their poses, or their corners.

    t,id,x,y,z,qx,qy,qz,qw,c_x_x,...,c_rz_rz     poses in the camera's frame with covariances, of `bench detect --poses`
    t,id,x,y,z,qx,qy,qz,qw                       poses alone
    t,id,u0,v0,u1,v1,u2,v2,u3,v3                 corners, px, around the tag

Rows of one time are of one frame. Columns may be in any order; others are ignored.
"""

from itertools import groupby
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.small_matrices import symmetric
from ...core.table import MOST
from ...frontend.camera.quaternions import matrix
from ..formats.columns import in_order, read_columns
from .found_tags import FoundTag, TagFrame, fault_of
from .poses_csv import COV, PLACE, TURN

TAGS = "tags.csv"

_POSE = ("t", "id", *PLACE, *TURN)
_CORNERS = ("t", "id", *(f"{axis}{k}" for k in range(4) for axis in "uv"))


def read_tags(path: Path, remarks: list[str]) -> list[TagFrame]:
    """The frames with tags, in order; InputError names the file and line of a fault. `remarks` grows."""
    table = in_order(read_columns(path, (*_POSE, *COV), _POSE, _CORNERS), strictly=False)
    if table.columns == _POSE and len(table.rows):
        remarks.append(f"{path}: has no covariances (c_x_x to c_rz_rz): poses have the stated noise")
    ids = table.whole("id")
    for row in np.flatnonzero((ids < 0) | (ids > MOST)):
        raise table.fault(row, f"id is {ids[row]}, expected 0 to {MOST}")
    numbers = table.rows[:, 2:]
    covs = symmetric(numbers[:, 7:]) if table.columns == (*_POSE, *COV) else None
    found = list[FoundTag]()
    for row, name in enumerate(ids.tolist()):
        if table.columns == _CORNERS:
            corners = numbers[row].reshape(4, 2)
            found.append(FoundTag(name, corners=corners))
            continue
        cov = None if covs is None else covs[row]
        if (fault := fault_of(numbers[row, :7], cov, None)) is not None:
            raise table.fault(row, fault)
        found.append(FoundTag(name, matrix(numbers[row, :7]), cov))
    rows = zip(table.column("t").tolist(), found, strict=True)
    frames = [TagFrame(t, [tag for _, tag in same]) for t, same in groupby(rows, key=lambda row: row[0])]
    if not frames:
        raise InputError(f"{path}: found no rows, expected at least one.")
    return frames
