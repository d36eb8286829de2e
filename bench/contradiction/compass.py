"""Headings in the world that are a constant off: a declination that nobody stated, or a compass that sits askew.

Each heading less that of the true path is the constant and noise. Without a true path, the odometry's way along the
headings is as far turned from the way through the positions as the headings are off. Without these, the start tells:
the heading by odometry after k motions has the variance of the start and of k turns, which those after it share.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, act, wrap
from ...core.truth.doubts import judges
from ...core.truth.errors import rows_of
from ...datasets.tables.csv_tables import START_UNKNOWN
from ..words.numerals import number

FEWEST, MOST = 8, 100
"""Headings that tell, or positions of a stretch, at least, and headings after the start, at most: later ones tell of
the odometry's drift."""

BLOCKS = 16
"""Stretches of time whose means tell how sure the mean is, as errors of a compass stay the same for some metres."""

STRETCHES = (3, 6, 12, 24, 48, 96)
"""Numbers of stretches of positions: drift is small in short ones, noise in long ones."""

SURE = 5.0
"""Standard deviations of a constant, from which on it is no chance."""

MATTERS = 0.5
"""Of the stated noise of a heading: less is seldom noticed."""

STATED = 3.0
"""Standard deviations of a constant that the prior states, up to which the log knows of it."""

STEADY = 0.9
"""Mean resultant length of angles that are one but for 0.46 rad."""

AGREE = 2.0
"""Noise that is left over what is stated, up to which the odometry from the start explains the headings."""

KNOWN = 0.5
"""rad, the standard deviation of a start's heading, or of a stretch's turn, up to which it is known."""


Complex = NDArray[np.complexfloating[Any, Any]]


class _Off(NamedTuple):
    """A constant of headings."""

    angle: float  # rad, too far left
    sd: float  # rad
    by: str  # what the headings are compared with


class _Headings(NamedTuple):
    """The headings of a log."""

    step: Ints  # (h,)
    z: Array  # (h,) rad
    sd: Array  # (h,) rad, as stated


def turned_compass(log: Log, truth: Truth | None = None) -> Iterator[str]:
    """Says by how much the headings in the world are off, if the log does not state it, and what takes it out."""
    found = _headings(log)
    if found is None:
        return
    if truth is not None and truth.kind == "truth" and len(truth.t) and judges(log, truth):
        off = _by_truth(log, truth, found)
    else:
        off = _by_positions(log, found) or _by_start(log, found)
    stated = STATED * log.prior.systematic.heading_offset
    noise = float(np.median(found.sd))
    if off is None or abs(off.angle) <= max(SURE * off.sd, MATTERS * noise, stated):
        return
    size, side = number(abs(float(np.rad2deg(off.angle)))), "left" if off.angle > 0 else "right"
    sure, change = number(1.96 * float(np.rad2deg(off.sd))), "larger" if off.angle > 0 else "smaller"
    yield (
        f"headings in the world are {size} ± {sure} degrees too far {side} by {off.by}, as by a declination that is "
        f"not stated: declination of csv, or of [compass] in robot.toml, {change} by {number(abs(off.angle))} rad "
        "takes it out; with heading_offset of csv, or [compass] offset_sd, backends estimate it as a state"
    )


def _headings(log: Log) -> _Headings | None:
    """Those of a log; None of fewer than FEWEST."""
    if log.fixes is None:
        return None
    row = np.flatnonzero(~np.isnan(log.fixes.z[:, 2]))
    if len(row) < FEWEST:
        return None
    return _Headings(log.fixes.step[row], log.fixes.z[row, 2], np.sqrt(log.fixes.cov[row, 2, 2]))


def _centre(angles: Array) -> float | None:
    """The direction (rad) of angles (n,) that are nearly one; None of others."""
    mean = np.exp(1j * angles).mean()
    return float(np.angle(mean)) if abs(mean) > STEADY else None


def _by_truth(log: Log, truth: Truth, found: _Headings) -> _Off | None:
    """By the mean of headings less the true ones."""
    row = rows_of(truth.t, log.t[found.step])
    off = wrap(found.z[row >= 0] - truth.poses[row[row >= 0], 2])
    if len(off) < FEWEST or (centre := _centre(off)) is None:
        return None
    blocks = np.array([centre + wrap(part - centre).mean() for part in np.array_split(off, min(BLOCKS, len(off)))])
    sd = float(blocks.std(ddof=1)) / np.sqrt(len(blocks))
    sd = max(sd, float(np.median(found.sd)) / np.sqrt(len(off)))
    return _Off(centre + float(np.median(wrap(off - centre))), sd, "the true path")


def _by_positions(log: Log, found: _Headings) -> _Off | None:
    """By positions: the way that the odometry measures along the headings is turned onto them in stretches.

    The surest of several numbers of stretches tells.
    """
    if log.fixes is None:
        return None
    row = np.flatnonzero(~np.isnan(log.fixes.z[:, :2]).any(axis=1))
    path, step = _along(log, found), log.fixes.step[row]
    p, q = act(path[step], log.fixes.arm[row]) @ (1, 1j), log.fixes.z[row, :2] @ (1, 1j)
    sd = np.sqrt(np.einsum("nii->n", log.fixes.cov[row, :2, :2]) / 2)
    noise, offs = float(np.median(found.sd)) / np.sqrt(len(found.z)), list[_Off]()
    for parts in STRETCHES:
        if len(row) >= FEWEST * parts and (one := _of_stretches(p, q, sd, parts)) is not None:
            offs.append(one._replace(sd=float(np.hypot(one.sd, noise))))
    return min(offs, key=lambda one: one.sd, default=None)


def _along(log: Log, found: _Headings) -> Array:
    """(n, 3) the path of motions by odometry with headings as measured, between two of these by the odometry."""
    path = log.dead_reckoned()
    path[:, 2] += np.interp(np.arange(len(path)), found.step, np.unwrap(found.z - path[found.step, 2]))
    path[1:, :2] = path[0, :2] + np.cumsum(act(path[:-1], log.delta[1:, :2]) - path[:-1, :2], axis=0)
    return path


def _of_stretches(p: Complex, q: Complex, sd: Array, parts: int) -> _Off | None:
    """By a number of stretches of positions q at p along the headings (complex): what these are too far left by."""
    angles, variances = list[float](), list[float]()
    for rows in np.array_split(np.arange(len(p)), parts):
        a, b = p[rows] - p[rows].mean(), q[rows] - q[rows].mean()
        total = float((np.abs(a) ** 2).sum())
        if not total > 0:
            continue
        fit = complex((a.conj() @ b) / total)
        left = float((np.abs(b - fit * a) ** 2).sum()) / (2 * (len(rows) - 2))
        variance = max(left, float(np.median(sd[rows])) ** 2) / total
        if variance < KNOWN**2 * abs(fit) ** 2:
            angles.append(-float(np.angle(fit)))
            variances.append(variance / abs(fit) ** 2)
    if len(angles) < STRETCHES[0] or (centre := _centre(np.array(angles))) is None:
        return None
    weight = 1 / np.array(variances)
    apart = wrap(np.array(angles) - centre)
    mean = float(weight @ apart / weight.sum())
    scatter = float(weight @ (apart - mean) ** 2) / (len(angles) - 1)
    sd_mean = float(np.sqrt(max(scatter, 1.0) / weight.sum()))
    return _Off(centre + mean, sd_mean, "the way through the positions")


def _by_start(log: Log, found: _Headings) -> _Off | None:
    """By the odometry from the start, where that is known, and explains how headings turn."""
    if log.prior.start != "known" or log.prior.cov[2, 2] > KNOWN**2 or _start_unknown(log):
        return None
    step, z, sd = found.step[:MOST], found.z[:MOST], found.sd[:MOST]
    off = wrap(z - log.dead_reckoned()[step, 2])
    if (centre := _centre(off)) is None:
        return None
    off = wrap(off - centre)
    var = log.prior.cov[2, 2] + np.concatenate(([0.0], np.cumsum(log.delta_cov[1:, 2, 2])))[step]
    weight = np.linalg.inv(np.minimum(var[:, None], var[None, :]) + np.diag(sd**2))
    mean = float(weight.sum(axis=0) @ off / weight.sum())
    left = off - mean
    if float(left @ weight @ left) / (len(off) - 1) > AGREE**2:
        return None
    return _Off(centre + mean, float(1 / np.sqrt(weight.sum())), "the start and the odometry from there")


def _start_unknown(log: Log) -> bool:
    return any(START_UNKNOWN in said for said in log.remarks)
