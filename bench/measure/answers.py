"""Checks the answers of a backend against the contract: types, shapes, finite numbers, ids.

None of it is timed; where it stands between timed calls it is cheap as long as it passes.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any, TypeGuard

import numpy as np

from ...backends.api import (
    Associates,
    AssociatesPartial,
    Backend,
    Bias,
    Calibrates,
    Calibration,
    Constant,
    Diverged,
    Solution,
)
from ...core.errors import SlamduelError
from ...core.factors import Log, Map
from ...core.se2 import Array, Ints
from ...core.truth.errors import difference

FARTHEST = 1e9  # m from the origin: more than any coordinates on Earth, national grids included

SAME = 1e-9  # m and rad by which a belief's pose may differ from the step's
ULPS = 64  # by which it may differ besides, for the rounding of large coordinates

POSE, COV = (3,), (3, 3)
_FLOAT = np.dtype(np.float64)


class Broken(SlamduelError):
    """A backend broke the contract: what it returned, and what was expected."""


def checked_pose(pose: Any, k: int) -> bytes:
    """Copies what step() returned at step k, after a check that is cheap where it passes."""
    if is_floats(pose, POSE):
        x, y, heading = pose.tolist()
        if -FARTHEST <= x <= FARTHEST and -FARTHEST <= y <= FARTHEST and isfinite(heading):
            return pose.tobytes()
    return _on_earth(pose, POSE, f"step {k}: the pose").tobytes()


def check_believed(poses: Array, steps: Sequence[int], online: Array | None) -> None:
    """Raises for the first belief at these steps whose pose is not that of its step, where this gave one."""
    for row in np.flatnonzero(~np.isfinite(poses).all(axis=1))[:1]:
        finite(poses[row], POSE, f"step {steps[row]}: the belief's pose")
    if online is None or not len(poses):
        return
    returned = online[steps]
    off = np.abs(difference(poses, returned))
    allowed = SAME + ULPS * np.finfo(np.float64).eps * np.abs(returned).max(axis=1)
    for row in np.flatnonzero(off.max(axis=1) > allowed)[:1]:
        raise Broken(f"step {steps[row]}: the belief's pose is {poses[row]}, expected the step's, {returned[row]}")


def is_floats(values: Any, shape: tuple[int, ...]) -> TypeGuard[Array]:
    """True for an array of float64 of that shape."""
    return type(values) is np.ndarray and values.shape == shape and values.dtype is _FLOAT


def check_again(pose: Any, online: Array | None, k: int) -> None:
    """Raises Broken unless the pose, if there is one, is the same as without asking for beliefs."""
    again = None if pose is None else np.frombuffer(checked_pose(pose, k))
    if online is not None and (again is None or again.tobytes() != online[k].tobytes()):
        raise Broken(f"step {k}: the path differs once beliefs are asked for: {again}, expected {online[k]}")


def checked_covs(covs: bytearray, known: Sequence[int], n: int) -> Array:
    """Returns (n, 3, 3) from the bytes of those known at these steps; Diverged names the first that is not finite."""
    cov, found = np.full((n, *COV), np.nan), np.frombuffer(covs).reshape(-1, *COV)
    for row in np.flatnonzero(~np.isfinite(found).all(axis=(1, 2)))[:1]:
        finite_cov(found[row], known[row])
    cov[known] = found
    return cov


def finite_cov(cov: Any, k: int) -> Array:
    """Copies a belief's covariance at step k; Broken or Diverged where it is not what the contract says."""
    return finite(cov, COV, f"step {k}: the belief's covariance")


def checked_assigned(backend: Backend, log: Log) -> Ints | None:
    """Asks a backend with data association which landmark every sighting is of; Broken for another answer."""
    return _ids(backend.assigned(), log.ids.shape, "assigned()") if isinstance(backend, Associates) else None


def checked_assigned_partial(backend: Backend, log: Log) -> Ints | None:
    """Likewise of every partial sighting of a log that has some."""
    if log.partial is None or not isinstance(backend, AssociatesPartial):
        return None
    return _ids(backend.assigned_partial(), log.partial.ids.shape, "assigned_partial()")


def _ids(found: Any, shape: tuple[int, ...], where: str) -> Ints | None:
    if found is None:
        return None
    if not (isinstance(found, np.ndarray) and found.dtype == np.int64 and found.shape == shape):
        other = getattr(found, "shape", "")
        raise Broken(f"{where} returned {type(found).__name__} {other}, expected int64 {shape}")
    return found


def checked_solution(solution: Any, n: int) -> Solution | None:
    """Copies what finish() returned after n steps: Broken or Diverged where it is not what the contract says."""
    if solution is None:
        return None
    if not isinstance(solution, Solution):
        raise Broken(f"finish() returned {type(solution).__name__}, expected Solution or None")
    path = _on_earth(solution.path, (n, 3), "finish(): the path")
    cov = solution.cov
    if cov is not None and not is_floats(cov, (n, *COV)):
        cov = _shaped(cov, (n, *COV), "finish(): the poses' covariance")
    if not is_convergence(solution.converged):
        raise Broken(f"finish(): converged is {solution.converged!r}, expected True, False or None")
    converged = None if solution.converged is None else bool(solution.converged)
    if not isinstance(solution.remark, str):  # pyright: ignore[reportUnnecessaryIsInstance] - a backend may return anything
        raise Broken(f"finish(): the remark is {type(solution.remark).__name__}, expected str")
    landmarks = checked_map(solution.map, "finish()")
    constant = _checked_constant(solution.constant, len(landmarks.ids), "finish()")
    bias = _checked_bias(solution.gyro_bias, "finish()")
    return Solution(path, landmarks, cov, converged, solution.remark, constant, bias)


def checked_calibration(backend: Backend) -> Calibration:
    """Copies the constant errors that a backend has estimated along the way; none of one that estimates none."""
    if not isinstance(backend, Calibrates):
        return Calibration()
    found: Any = backend.calibration()
    if not isinstance(found, Calibration):
        raise Broken(f"calibration() returned {type(found).__name__}, expected Calibration")
    n = 1 if found.constant is None or np.shape(found.constant.range_scale) == (1,) else len(backend.map().ids)
    constant = _checked_constant(found.constant, n, "calibration()")
    return Calibration(constant, _checked_bias(found.gyro_bias, "calibration()"))


def _checked_bias(found: Any, where: str) -> Bias | None:
    return None if found is None else Bias(*finite(np.array(found), (2,), f"{where}: gyro_bias").tolist())


def _checked_constant(found: Any, n: int, where: str) -> Constant | None:
    """Copies the constant errors of n landmarks, or of all."""
    if found is None:
        return None
    if not isinstance(found, Constant):
        raise Broken(f"{where}: constant is {type(found).__name__}, expected Constant or None")
    shape = (n,) if np.shape(found.range_scale) != (1,) else (1,)
    sd = found.sd
    if sd is not None:
        sd = _constant(sd, shape, f"{where}: the standard deviation of")
        if min(float(np.min(one, initial=0.0)) for one in sd[:4]) < 0:
            raise Broken(f"{where}: a standard deviation of a constant error is negative, expected 0 or more")
    return _constant(found, shape, f"{where}:")._replace(sd=sd)


def _constant(found: Any, shape: tuple[int, ...], where: str) -> Constant:
    if not isinstance(found, Constant):
        raise Broken(f"{where} constant errors is {type(found).__name__}, expected Constant or None")
    scale, offset = (finite(getattr(found, name), shape, f"{where} {name}") for name in ("range_scale", "range_offset"))
    heading, wheels = (
        float(finite(getattr(found, name), (), f"{where} {name}")) for name in ("heading_offset", "wheel_scale")
    )
    return Constant(scale, offset, heading, wheels)


def is_convergence(value: Any) -> bool:
    """Tells if a solution can say this of its convergence."""
    return value is None or isinstance(value, bool | np.bool)


def checked_map(found: Any, where: str) -> Map:
    """Copies a map that `where` returned: Broken or Diverged where it is not what the contract says."""
    if not isinstance(found, Map):
        raise Broken(f"{where} returned {type(found).__name__} for a map, expected Map")
    ids = _checked_ids(found.ids, where)
    n = len(ids)
    cov = None if found.cov is None else finite(found.cov, (2 * n, 2 * n), f"{where}: the map's covariance")
    return Map(ids, finite(found.xy, (n, 2), f"{where}: the map"), cov)


def _checked_ids(found: Any, where: str) -> Ints:
    """Copies a map's ids; Broken unless they are whole numbers, each there once."""
    ids = np.array(found)
    if ids.ndim != 1 or (ids.dtype.kind not in "iu" and ids.size):
        raise Broken(f"{where}: the map's ids are {ids.dtype} of shape {ids.shape}, expected n whole numbers")
    there, times = np.unique(ids, return_counts=True)
    if len(there) < len(ids):
        raise Broken(f"{where}: the map has landmark {there[times.argmax()]} {times.max()} times, expected once")
    return ids.astype(np.int64)


def _on_earth(poses: Any, shape: tuple[int, ...], what: str) -> Array:
    """Checks as `finite`, for poses: beyond `FARTHEST` the numbers mean nothing any more."""
    found = finite(poses, shape, what)
    far = float(np.abs(found[..., :2]).max(initial=0.0))
    if far > FARTHEST:
        raise Diverged(f"{what} is {far:.1e} m from the origin, farther than the {FARTHEST:.0e} m of any log")
    return found


def finite(values: Any, shape: tuple[int, ...], what: str) -> Array:
    """Copies `values`; Broken unless of that shape, Diverged unless finite."""
    array = _shaped(values, shape, what)
    if not np.isfinite(array).all():
        raise Diverged(f"{what} is not finite: {array if array.size <= 9 else 'an array'}")
    return array


def _shaped(values: Any, shape: tuple[int, ...], what: str) -> Array:
    try:
        if np.iscomplexobj(values):  # numpy would drop the imaginary part
            raise TypeError
        array = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise Broken(f"{what} is {type(values).__name__}, expected an array of floats of shape {shape}") from None
    if array.shape != shape:
        raise Broken(f"{what} has shape {array.shape}, expected {shape}")
    return array
