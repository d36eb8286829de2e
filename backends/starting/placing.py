"""The late start of landmarks that one sighting does not place: the same choice behind every backend.

The sightings are from poses that are not known exactly: they have drifted, one against the other, since the first. Two
bearings from poses whose headings are off by as much as the bearings differ place nothing. So a place is that of least
squares by the sightings' noise and that drift together, seen from the last pose, and it is good enough if it is so with
both.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from ...core.partial import RANGE
from ...core.se2 import Array, Ints, wrap
from ._placing import SCALE, STARTS, best, minima

CLEAR = 13.8
"""Twice the loss by which the place must be better than any elsewhere: odds of a thousand to one."""

SPREAD = 0.15
"""Most that a place may be off, one standard deviation, in its distances from the poses that saw it.

Beyond, the errors of a linearised range or bearing are no longer small.
"""


FLAT = 0.1
"""Most that a ring may bend away from its tangent within one standard deviation of a place, in those of a range.

At the distance r that is spread² / 2 r. A linear correction takes it for an error of the range, of all ranges of a
landmark alike. Of 0.03, 0.1, 0.25 and any, 20 simulated drives each with ranges to 0.05, 0.2 and 0.5 m, on a circle of
3 m, have the least error of an EKF with 0.1, by up to 4 %.
"""

APART = 0.1
"""Least distance of one place from another, in that from the last pose."""

FLATTEST = 1e-9
"""Least determinant of a minimum's information, in its squared trace: between two mirrored places there is none."""


TURNED = 0.3
"""rad; most drift of the heading of a pose, one standard deviation, seen from the last, whose sightings place.

A turn moves what is seen across it on an arc: beyond, that is no longer a straight line. Of a landmark that returns
after a lap, those of the lap before had all mirrored places by ranges on the wrong side, with any certainty.
"""

REFINED = 3
"""Gauss-Newton steps of a place with drift, from one without correlations."""


class Place(NamedTuple):
    """The place of a landmark from its partial sightings."""

    xy: Array  # (2,) m
    cov: Array  # (2, 2), of the sightings' noise and the drift, as seen from the last pose
    clear: float  # twice the loss by which it is better than any other place
    sure: bool  # False while there may be another place, or it is not precise enough to linearise at


def placed(poses: Array, kind: Ints, z: Array, var: Array, drift: Array | None = None) -> Place | None:
    """Places a landmark by k sightings, each of a range or a bearing: poses (k, 3), z (k,) and variances (k,).

    `drift` (3k, 3k) is the covariance of the poses as seen from the last of them (see `drift.relative`); without, they
    are taken for exact. None where the sightings determine no place at all.
    """
    loose = var
    if drift is not None:
        own = np.einsum("iaia->ia", drift.reshape(len(z), 3, len(z), 3))
        straight = own[:, 2] < TURNED**2
        if not straight.all():
            poses, kind, z, var, own = poses[straight], kind[straight], z[straight], var[straight], own[straight]
            drift = drift[np.ix_(np.repeat(straight, 3), np.repeat(straight, 3))]
        loose = var + np.where(kind == RANGE, own[:, :2].mean(axis=1), own[:, 2])
    xy, of_noise = np.empty(2), np.empty((2, 2))
    found, clear = best(poses, kind, z, loose, xy, of_noise)
    if not found:
        return None
    xy, cov = (xy, of_noise) if drift is None else _refined(xy, of_noise, poses, kind, z, var, drift)
    near = np.hypot(*(poses[:, :2] - xy).T).min()
    precise = np.linalg.eigvalsh(cov)[-1] < (SPREAD * near) ** 2
    flat = np.linalg.eigvalsh(of_noise)[-1] < 2 * near * FLAT * _least_sd(kind, var)
    return Place(xy, cov, float(clear), bool(clear > CLEAR and precise and flat))


def _refined(
    xy: Array, cov: Array, poses: Array, kind: Ints, z: Array, var: Array, drift: Array
) -> tuple[Array, Array]:
    """The place (2,) near `xy` by sightings whose errors the drift correlates, and its covariance (2, 2).

    A sighting far off has a larger variance, as by the Cauchy loss. Where least squares fail, the place stays.
    """
    k, least = len(z), np.inf
    spread, at = drift.reshape(k, 3, k, 3), xy
    for _ in range(REFINED + 1):
        H, by_pose, off = _residual(at, poses, kind, z)
        noise = np.einsum("ia,iajb,jb->ij", by_pose, spread, by_pose)
        far = off * off / (SCALE * SCALE * (noise.diagonal() + var))
        noise[np.arange(k), np.arange(k)] += var * (1 + far)
        root = np.linalg.cholesky(noise)
        white = solve_triangular(root, np.column_stack((H, off)), lower=True)
        loss = float(white[:, 2] @ white[:, 2]) + float(2 * np.log(np.diagonal(root)).sum())
        information = white[:, :2].T @ white[:, :2]
        if not loss < least or not np.linalg.det(information) > FLATTEST * np.trace(information) ** 2:
            break
        xy, cov, least = at, np.linalg.inv(information), loss
        at = xy + cov @ (white[:, :2].T @ white[:, 2])
    return xy, cov


def _residual(xy: Array, poses: Array, kind: Ints, z: Array) -> tuple[Array, Array, Array]:
    """Jacobians (k, 2) by the place and (k, 3) by the poses, and what is measured beyond what is expected (k,)."""
    away = xy - poses[:, :2]
    q = np.maximum((away**2).sum(axis=1), 1e-18)
    r, ranges = np.sqrt(q), kind == RANGE
    H = np.where(ranges[:, None], away / r[:, None], np.column_stack((-away[:, 1], away[:, 0])) / q[:, None])
    expected = np.where(ranges, r, np.arctan2(away[:, 1], away[:, 0]) - poses[:, 2])
    off = np.where(ranges, z - expected, wrap(z - expected))
    return H, np.column_stack((-H, np.where(ranges, 0.0, -1.0))), off


def _least_sd(kind: Ints, var: Array) -> float:
    """The least standard deviation of a range, m; infinite without one."""
    return float(np.sqrt(var[kind == RANGE].min(initial=np.inf)))


def places(poses: Array, kind: Ints, z: Array, var: Array) -> list[Array]:
    """The places (2,) that k sightings leave open, likeliest first: minima of their robust loss that are `APART`."""
    points, losses, J = np.empty((2 * STARTS, 2)), np.empty(2 * STARTS), np.empty((2 * STARTS, 5))
    n = minima(poses, kind, z, var, points, losses, J)
    curved = J[:n, 0] * J[:n, 2] - J[:n, 1] ** 2 > FLATTEST * (J[:n, 0] + J[:n, 2]) ** 2
    found = list[Array]()
    for k in np.argsort(losses[:n], kind="stable"):
        if curved[k] and all(are_apart(points[k], one, poses[-1]) for one in found):
            found.append(points[k].copy())
    return found


def are_apart(a: Array, b: Array, pose: Array) -> bool:
    """Tells if two places (2,) are different ones, seen from a pose (3,)."""
    return bool(np.hypot(*(a - b)) > APART * np.hypot(*(a - pose[:2])))
