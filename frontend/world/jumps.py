"""Positions that no robot can have reached: a receiver that jumps, and one that has latitude and longitude swapped."""

from typing import NamedTuple

import numpy as np

from ...core.factors import Log
from ...core.se2 import Array, Ints
from .measured import Measured

GATE = 6.0  # standard deviations of two positions beyond the way between them
SLACK = 1.0  # m beside, as receivers state too little
FAST = 5.0  # m/s of a robot whose way nothing measured
SHORT = 0.1  # share of all positions, below which those between two jumps are left out
MIRRORED = 0.5  # of the error as they are, below which that of the mirrored positions says that they are mirrored
STRAIGHT = 0.1  # of the length of a way, that its breadth has at least to tell left from right


class Fit(NamedTuple):
    """A path laid upon positions by a turn and a shift."""

    turn: float  # rad
    shift: Array  # (2,) m
    error: float  # m, root mean square that is left
    breadth: float  # m, root mean square of the path across its length


def fitted(path: Array, xy: Array, *, mirrored: bool = False) -> Fit:
    """The turn and shift that take points `path` (f, 2) nearest to `xy` (f, 2), or to these with x and y swapped."""
    goal = xy[:, ::-1] if mirrored else xy
    a, b = path - path.mean(axis=0), goal - goal.mean(axis=0)
    turn = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    c, s = np.cos(turn), np.sin(turn)
    laid = a @ np.array([[c, s], [-s, c]])
    shift = goal.mean(axis=0) - np.array([[c, -s], [s, c]]) @ path.mean(axis=0)
    error = float(np.sqrt(((laid - b) ** 2).sum(axis=1).mean()))
    return Fit(turn, shift, error, float(np.sqrt(np.linalg.eigvalsh(a.T @ a / len(a))[0])))


def without_jumps(source: str, found: Measured, way: Array | None, remarks: list[str]) -> Measured:
    """Positions without those that are out of reach of the others; `way` (f - 1,), m, is that by the odometry.

    Parts between two jumps that are SHORT are left out. Longer ones stay: nobody knows which one is right. Both are
    remarks.
    """
    if len(found.t) < 2:
        return found
    label = _parts(found, way)
    size = np.bincount(label)
    gone = size[label] < max(SHORT * len(label), 1.5)
    if size.max() < 1.5:
        gone[:] = False
    if gone.any():
        row = int(np.flatnonzero(gone)[0])
        near = int(np.flatnonzero(~gone)[np.argmin(np.abs(np.flatnonzero(~gone) - row))])
        far = float(np.hypot(*(found.z[row, :2] - found.z[near, :2])))
        remarks.append(
            f"{source}: {int(gone.sum())} of {len(gone)} positions are out of the robot's reach from those before and "
            f"after them, the first at {found.t[row]:.10g} s by {far:.3g} m, and are left out"
        )
    several = len(set(label[~gone].tolist()))
    if several > 1:
        kept = np.flatnonzero(~gone)
        at = next(k for k in range(1, len(kept)) if label[kept[k]] != label[kept[k - 1]])
        one, other = kept[at - 1], kept[at]
        far = float(np.hypot(*(found.z[other, :2] - found.z[one, :2])))
        remarks.append(
            f"{source}: positions jump by {far:.3g} m between {found.t[one]:.10g} and {found.t[other]:.10g} s and stay "
            "there, farther than the robot drove: nothing says which are right; a backend's loss or gate may"
        )
    return found.taken(~gone)


def _parts(found: Measured, way: Array | None) -> Ints:
    """(f,) a number for each position: those in reach of one another, as they come, have the same."""
    xy, var = found.z[:, :2], np.trace(found.cov[:, :2, :2], axis1=1, axis2=2)
    along = np.concatenate(([0.0], np.cumsum(FAST * np.diff(found.t) if way is None else 1.2 * way)))
    label, last = np.zeros(len(xy), np.int64), list[int]()  # the last row of each part
    for k in range(len(xy)):
        for number, row in sorted(enumerate(last), key=lambda one: -one[1]):
            far = float(np.hypot(*(xy[k] - xy[row])))
            if far <= along[k] - along[row] + GATE * float(np.sqrt(var[k] + var[row])) + SLACK:
                label[k] = number
                last[number] = k
                break
        else:
            label[k] = len(last)
            last.append(k)
    return label


def elsewhere(source: str, found: Measured, log: Log, *, driven: bool) -> list[str]:
    """The remark on positions whose first one is out of reach of the log's given start; none if not.

    The way until then is the odometry's where it is that of a robot that was `driven` by measured motions.
    """
    first, prior = found.taken(np.arange(1)), log.prior
    (before,) = np.flatnonzero(log.t <= first.t[0])[-1:]
    way = FAST * float(first.t[0] - log.t[0])
    if driven:
        way = float(np.hypot(*log.delta[1 : before + 2, :2].T).sum())
    off = float(np.hypot(*(first.z[0, :2] - prior.pose[:2])))
    sd = float(np.sqrt(np.trace(prior.cov[:2, :2]) + np.trace(first.cov[0, :2, :2])))
    if off <= way + float(np.hypot(*first.arm[0])) + GATE * sd + SLACK:
        return []
    said = (
        f"{source}: the first position, at {first.t[0]:.10g} s, is {off:.3g} m from the start that [prior] gives, and "
        f"the robot drove {way:.3g} m until then: expected [gps] origin at the place from which [prior] counts, x to "
        "the east, or no [prior]"
    )
    return [said]


def swapped(source: str, path: Array, found: Measured) -> list[str]:
    """The remark on positions that are the mirror image of the `path` (f, 2) by the odometry, m; none if not."""
    xy = found.z[:, :2]
    if len(xy) < 4:
        return []
    own, mirror = fitted(path, xy), fitted(path, xy, mirrored=True)
    sd = float(np.sqrt(np.trace(found.cov[:, :2, :2], axis1=1, axis2=2).mean()))
    length = float(np.sqrt(np.linalg.eigvalsh(np.cov((path - path.mean(axis=0)).T, bias=True))[-1]))
    if own.breadth < STRAIGHT * length or own.breadth < sd or not mirror.error < MIRRORED * own.error:
        return []
    said = (
        f"{source}: the positions turn to the other side than the odometry: laid upon it they are {own.error:.3g} m "
        f"off, with x and y swapped {mirror.error:.3g}: perhaps latitude and longitude are swapped, or the odometry "
        "turns the wrong way"
    )
    return [said]
