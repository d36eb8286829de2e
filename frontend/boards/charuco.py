"""Calibrates a camera from views of a board.

OpenCV estimates the camera; the uncertainty is computed here, and views that do not determine the camera are refused
with the reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array
from ..camera.camera import Camera
from .view import View

FEWEST_VIEWS = 4
LEAST_TURN = 2.0
"""Least largest difference, in degrees, of the board's orientations: below, the focal length is unobservable."""

ENOUGH_TURN = 20.0
"""Degrees from which a poorly determined focal length is not due to a lack of tilt."""

LARGEST_SD, LARGE_SD = 0.05, 0.01
"""Relative standard deviations of the focal length: above the first is refused, above the second remarked on."""

GRID = (8, 6)  # cells across and down for the share of the image that corners cover

LEAST_COVERAGE = 0.5
OUTLYING = 2.5  # multiple of the median error from which a view is reported as bad
_ROUNDING = 1e-15  # eigenvalues of the scaled normal matrix below this count as zero

MODELS = {
    "5": 0,
    "8": cv2.CALIB_RATIONAL_MODEL,
    "14": cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL | cv2.CALIB_TILTED_MODEL,
    "fisheye": cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW,
}
"""Lens model -> OpenCV's flags; a number is that of a pinhole's coefficients."""

FISHEYE_STARTS = (1 / np.pi, 0.5, 0.75)
"""Initial focal lengths of a fisheye, in units of the image's longer side; the first is that of 180 degrees."""


class ViewFit(NamedTuple):
    """The fit of one view."""

    view: View
    residuals: Array  # (n, 2) px, seen minus expected
    error: float  # px, RMS distance
    pose: Array  # (4, 4) T_camera_board
    bad: bool  # far worse than the others


class _Solution(NamedTuple):
    """The output of OpenCV's calibrations."""

    k: Array  # (3, 3)
    d: Array  # (d,) or more
    turns: Sequence[Array]  # one rotation vector per view
    shifts: Sequence[Array]  # m


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera and its uncertainty."""

    camera: Camera  # mounted at the robot's origin, axes alike
    fits: list[ViewFit]
    rms: float  # px, of all corners' distances
    sd: Array  # (4 + d,) of fx, fy, cx and cy, px, and of the lens's coefficients
    turn: float  # degrees between the two views that differ most in the board's orientation
    coverage: float  # share of the image's cells with a corner
    remarks: list[str]  # sentences


def calibrate(views: Sequence[View], size: tuple[int, int], model: str) -> Calibration:
    """Estimates the camera of `size` width and height (px) that took the `views`, with a lens of MODELS' `model`.

    InputError, with advice, where views are too few, too alike or do not determine the focal length.
    """
    if len(views) < FEWEST_VIEWS:
        raise InputError(
            f"calibration: found {len(views)} usable views of the board, expected at least {FEWEST_VIEWS}, better 15 "
            "to 30, tilted every way by 20 to 45 degrees"
        )
    camera, poses = _solve(views, size, model)
    fits: list[ViewFit] = []
    for view, pose in zip(views, poses, strict=True):
        residuals = view.corners - camera.project(view.points @ pose[:3, :3].T + pose[:3, 3])
        fits.append(ViewFit(view, residuals, float(np.sqrt((residuals**2).sum(axis=1).mean())), pose, bad=False))
    usual = float(np.median([fit.error for fit in fits]))
    fits = [fit._replace(bad=fit.error > OUTLYING * usual) for fit in fits]
    sd = _standard_deviations(camera, fits)
    normals = np.array([pose[:3, 2] for pose in poses])
    turn = float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1))).max())
    share = max(float(sd[0]) / camera.focal[0], float(sd[1]) / camera.focal[1])
    if turn < LEAST_TURN or not share <= LARGEST_SD:
        raise _undetermined(turn, share, model)
    corners = np.vstack([view.corners for view in views])
    covered = coverage(corners, size)
    rms = float(np.sqrt(np.mean(np.vstack([fit.residuals for fit in fits]) ** 2) * 2))
    remarks = _remarks(camera, fits, rms, share, float(covered.mean()))
    return Calibration(camera, fits, rms, sd, turn, float(covered.mean()), remarks)


def _undetermined(turn: float, share: float, model: str) -> InputError:
    """Words the error for views that leave the focal length uncertain, by a `share` of it, with advice."""
    uncertain = f"known to {100 * share:.2g} %" if share < 1 else "practically unknown"
    wanted = f"expected {100 * LARGEST_SD:g} % or better"
    if turn < ENOUGH_TURN:
        return InputError(
            f"calibration: found views that are too similar: the board turns by at most {turn:.1f} degrees from one to "
            f"the next, and the focal length is {uncertain}, {wanted}: add views with the board tilted by 20 to 45 "
            "degrees, to the left, right, top and bottom"
        )
    return InputError(
        f"calibration: found views that do not determine the lens model {model}: the focal length is {uncertain}, "
        f"{wanted}: add views with the board large and near the image's edges, or take a lens model with fewer "
        "coefficients"
    )


def coverage(corners: Array, size: tuple[int, int]) -> NDArray[np.bool_]:
    """(GRID across, GRID down) the cells of an image of `size` that contain one of the `corners` (n, 2), px."""
    edges = [np.linspace(-0.5, side - 0.5, parts + 1) for side, parts in zip(size, GRID, strict=True)]
    return np.histogram2d(corners[:, 0], corners[:, 1], edges)[0] > 0


def _solve(views: Sequence[View], size: tuple[int, int], model: str) -> tuple[Camera, list[Array]]:
    """OpenCV's camera and T_camera_board of each view."""
    solve = _fisheye if model == "fisheye" else _pinhole
    try:
        k, d, turns, shifts = solve(views, size, MODELS[model])
    except cv2.error:
        raise InputError(
            f"calibration: no camera with the lens model {model} could be estimated from these views; expected "
            "more views, with the board large and tilted every way, or another --model"
        ) from None
    poses: list[Array] = []
    for turn, shift in zip(turns, shifts, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(np.ravel(turn))[0], np.ravel(shift)
        poses.append(pose)
    focal, centre = (float(k[0, 0]), float(k[1, 1])), (float(k[0, 2]), float(k[1, 2]))
    lens = tuple(map(float, np.ravel(d)[: 4 if model == "fisheye" else int(model)]))
    return Camera(*size, focal, centre, lens, np.eye(4), "fisheye" if model == "fisheye" else "pinhole"), poses


def _pinhole(views: Sequence[View], size: tuple[int, int], flags: int) -> _Solution:
    points = [view.points.astype(np.float32) for view in views]
    corners = [view.corners.astype(np.float32) for view in views]
    start = np.zeros((3, 3)), np.zeros(14)
    solution: tuple[Any, ...] = cv2.calibrateCamera(points, corners, size, *start, flags=flags)
    return _Solution(*solution[1:])


def _fisheye(views: Sequence[View], size: tuple[int, int], flags: int) -> _Solution:
    """The best of several starts: from a bad one OpenCV's search fails or finds a local minimum."""
    points, corners = [view.points[None] for view in views], [view.corners[None] for view in views]
    best: tuple[Any, ...] | None = None
    failure: cv2.error | None = None
    for share in FISHEYE_STARTS:
        f = share * max(size)
        start = np.array([[f, 0, (size[0] - 1) / 2], [0, f, (size[1] - 1) / 2], [0, 0, 1]])
        try:
            solution: tuple[Any, ...] = cv2.fisheye.calibrate(
                points, corners, size, start, np.zeros(4), flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS
            )
        except cv2.error as error:
            failure = error
        else:
            if best is None or solution[0] < best[0]:
                best = solution
    if best is None:
        raise failure or cv2.error("every start failed")
    return _Solution(*best[1:])


def _standard_deviations(camera: Camera, fits: Sequence[ViewFit]) -> Array:
    """(4 + d,) of fx, fy, cx, cy and the distortion, with all poses marginalised out of the least-squares problem.

    The noise is that of the residuals. Huge where the views leave a parameter undetermined.
    """
    count = 4 + len(camera.distortion)
    normal = np.zeros((count, count))
    squares, numbers = 0.0, -count
    take = cv2.fisheye.projectPoints if camera.model == "fisheye" else cv2.projectPoints
    for fit in fits:
        turn = cv2.Rodrigues(fit.pose[:3, :3])[0]
        points = fit.view.points.reshape(-1, 1, 3)
        _, slopes = take(points, turn, fit.pose[:3, 3], camera.matrix, camera.coefficients)
        slopes = np.asarray(slopes, float)
        inner, outer = (slopes[:, :8], slopes[:, 8:14]) if camera.model == "fisheye" else (slopes[:, 6:], slopes[:, :6])
        left = np.linalg.qr(outer)[0]
        free = inner - left @ (left.T @ inner)  # the camera's information, this view's pose marginalised
        normal += free.T @ free
        squares += float((fit.residuals**2).sum())
        numbers += fit.residuals.size - 6
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, axes = np.linalg.eigh(normal / np.outer(scale, scale))
    variances = (axes**2 / np.maximum(values, _ROUNDING)).sum(axis=1)
    return np.sqrt(variances * squares / max(numbers, 1)) / scale


def _remarks(camera: Camera, fits: Sequence[ViewFit], rms: float, share: float, covered: float) -> list[str]:
    remarks: list[str] = []
    remarks += [
        f"{fit.view.name} fits badly, to {fit.error:.2f} px: check if it is blurred or the board is bent"
        for fit in fits
        if fit.bad
    ]
    if rms > 1:
        remarks.append(f"the corners fit to {rms:.1f} px only: check the board's dimensions, or try a richer lens")
    if share > LARGE_SD:
        remarks.append(f"the focal length is known to {100 * share:.1f} % only: add views with the board tilted more")
    if covered < LEAST_COVERAGE:
        remarks.append(
            f"corners were seen in {100 * covered:.0f} % of the image only: add views with the board near its edges"
        )
    rim = np.array([[0, 0], [camera.width - 1, 0], [0, camera.height - 1], [camera.width - 1, camera.height - 1]])
    if camera.model == "pinhole" and np.isnan(camera.undistort(rim)).any():
        remarks.append(
            "the lens model turns back within the image, making its corners unusable: add views with the "
            "board there, or take fewer coefficients"
        )
    return remarks
