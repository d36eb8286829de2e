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
from ._placing import APART as ELSEWHERE
from ._placing import SCALE, STARTS, best, minima, seen_from

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

CANDIDATES = 3
"""Most places that are compared with drift."""


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
    if drift is None:
        xy, cov = np.empty(2), np.empty((2, 2))
        found, clear = best(poses, kind, z, var, xy, cov)
        return _judged(xy, cov, cov, clear, poses, kind, var) if found else None
    own = np.einsum("iaia->ia", drift.reshape(len(z), 3, len(z), 3))
    near = own[:, 2] < TURNED**2
    if not near.all():
        poses, kind, z, var, own = poses[near], kind[near], z[near], var[near], own[near]
        drift = drift[np.ix_(np.repeat(near, 3), np.repeat(near, 3))]
    loose = var + np.where(kind == RANGE, own[:, :2].mean(axis=1), own[:, 2])
    candidates = [_refined(xy, poses, kind, z, var, drift) for xy in _candidates(poses, kind, z, loose)]
    curved = [one for one in candidates if one.cov is not None]
    if not curved:
        return None
    first = min(curved, key=lambda one: one.loss)
    assert first.cov is not None
    other = [one.loss for one in candidates if _distance(one.xy - first.xy, first.cov) > ELSEWHERE]
    J = np.empty(5)
    seen_from(poses, kind, z, loose, first.xy[0], first.xy[1], J)
    of_noise = np.linalg.inv(np.array([[J[0], J[1]], [J[1], J[2]]]))
    clear = min(other, default=np.inf) - first.loss
    return _judged(first.xy, first.cov, of_noise, clear, poses, kind, var)


def _judged(xy: Array, cov: Array, of_noise: Array, clear: float, poses: Array, kind: Ints, var: Array) -> Place:
    near = np.hypot(*(poses[:, :2] - xy).T).min()
    spread, bent = np.sqrt(np.linalg.eigvalsh(cov)[-1]), np.linalg.eigvalsh(of_noise)[-1] / (2 * near)
    flat = bent < FLAT * _least_sd(kind, var)
    return Place(xy, cov, float(clear), bool(clear > CLEAR and spread < SPREAD * near and flat))


def _distance(off: Array, cov: Array) -> float:
    """The squared Mahalanobis distance."""
    return float(off @ np.linalg.solve(cov, off))


class _Candidate(NamedTuple):
    """A place with drift."""

    xy: Array  # (2,)
    cov: Array | None  # (2, 2); None where J is flat
    loss: float  # twice


def _candidates(poses: Array, kind: Ints, z: Array, var: Array) -> list[Array]:
    """Minima (2,) of the robust loss that are different places, the least first."""
    points, losses, J = np.empty((2 * STARTS, 2)), np.empty(2 * STARTS), np.empty((2 * STARTS, 5))
    n = minima(poses, kind, z, var, points, losses, J)
    found, metric = list[Array](), list[Array]()
    for k in np.argsort(losses[:n], kind="stable"):
        xx, xy, yy = J[k, :3]
        offs = [points[k] - one for one in found]
        if all(float(off @ M @ off) > ELSEWHERE for off, M in zip(offs, metric, strict=True)):
            found.append(points[k].copy())
            metric.append(np.array([[xx, xy], [xy, yy]]))
    return found[:CANDIDATES]


def _refined(xy: Array, poses: Array, kind: Ints, z: Array, var: Array, drift: Array) -> _Candidate:
    """The place near `xy` by sightings whose errors are correlated by the drift; far ones have the robust weight."""
    k = len(z)
    spread = drift.reshape(k, 3, k, 3)
    best_so_far = _Candidate(xy, None, np.inf)
    for _ in range(REFINED + 1):
        H, by_pose, off = _residual(xy, poses, kind, z)
        noise = np.einsum("ia,iajb,jb->ij", by_pose, spread, by_pose)
        total = noise.diagonal() + var
        noise[np.arange(k), np.arange(k)] += var + off * off / (SCALE * SCALE) * (var / total)
        try:
            root = np.linalg.cholesky(noise)
        except np.linalg.LinAlgError:
            break
        white = solve_triangular(root, np.column_stack((H, off)), lower=True)
        loss = float(white[:, 2] @ white[:, 2]) + float(2 * np.log(np.diagonal(root)).sum())
        if not loss < best_so_far.loss:
            break
        information = white[:, :2].T @ white[:, :2]
        if not np.linalg.det(information) > FLATTEST * np.trace(information) ** 2:
            best_so_far = _Candidate(xy, None, loss)
            break
        cov = np.linalg.inv(information)
        best_so_far = _Candidate(xy, cov, loss)
        xy = xy + cov @ (white[:, :2].T @ white[:, 2])
    return best_so_far


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
