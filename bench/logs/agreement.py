"""The agreement of a log with its ground truth."""

from typing import NamedTuple

import numpy as np

from ...core.factors import Dataset, Log, Truth
from ...core.se2 import Array
from ...core.truth.errors import Errors, driven_errors, sighting_errors
from ..contradiction.constant import LEFT, Constant
from ..measure.landmark_places import Places, Scattered, judge, placed, scattered_ids
from ..measure.stated_noise import Measured, NoiseCheck, measured, noise_check
from ..systematic.words import sentences
from .part_errors import PartCheck, part_checks
from .shown_path import Shown


class Corrected(NamedTuple):
    """The agreement of a log with the ground truth without errors of sensor and wheels that stay."""

    errors: tuple[str, ...]  # in words, a sentence each
    sightings: NoiseCheck | None  # None: as they were, nearly, as the next
    odometry: NoiseCheck | None
    measured: Measured | None  # the sightings' noise, where those are not None


class Known(NamedTuple):
    """The ground truth of a log, and the log's agreement with it."""

    kind: str  # truth, reference or "" where no path is known
    steps: int  # with a known pose
    landmarks: int  # with a known place
    sightings: NoiseCheck | None  # with truth alone, as the next
    odometry: NoiseCheck | None
    measured: Measured | None  # the sightings' noise
    medians: bool  # both are against landmarks' median places, as true ones are unknown or elsewhere
    scattered: Scattered | None  # by a known path, where the landmarks' places are not
    drift_m: float | None  # of dead reckoning at the end of the known path
    drift_share: float | None  # of that path's length
    relations: int  # pairs of poses with a known motion
    corrected: Corrected | None = None  # where errors that stay are most of what the log is off by
    ranges: PartCheck | None = None  # alone, with truth, as the next
    bearings: PartCheck | None = None


def length_of(poses: Array) -> float:
    """The length of a path (n, 3), m."""
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def known_of(dataset: Dataset, drawn: Shown, stays: Constant | None) -> Known:
    """Compares a log with its ground truth; `drawn` is its path, `stays` its errors that stay."""
    log, truth = dataset
    at_sightings, at_odometry = _errors(log, truth, drawn.places)
    checks = _checks(log, at_sightings, at_odometry)
    path = truth if truth is not None and len(truth.t) else drawn.solved
    off = share = None
    if path is not None:
        off = float(np.hypot(*(drawn.reckoned[drawn.step[-1]] - drawn.poses[-1])[:2]))
        length = length_of(drawn.poses)
        share = off / length if length > 0 else None
    return Known(
        "" if path is None else path.kind,
        0 if path is None else len(path.t),
        0 if truth is None or truth.map is None else len(truth.map.ids),
        *checks,
        None if at_sightings is None else measured(at_sightings),
        at_sightings is not None and len(at_sightings.row) > 0 and drawn.places is not None,
        scattered_ids(drawn.places),
        off,
        share,
        0 if truth is None or truth.relations is None else len(truth.relations.delta),
        None if stays is None else _corrected(stays, truth, drawn, checks),
        *part_checks(log, truth),
    )


def _errors(log: Log, truth: Truth | None, places: Places | None) -> tuple[Errors | None, Errors | None]:
    """Errors of sightings and motions by the truth; None without one that judges the log."""
    right = judge(log, truth, places)
    return (None, None) if right is None else (sighting_errors(log, right), driven_errors(log, right))


def _checks(log: Log, seen: Errors | None, driven: Errors | None) -> tuple[NoiseCheck | None, NoiseCheck | None]:
    return (
        None if seen is None else noise_check(seen, log.z_cov),
        None if driven is None else noise_check(driven, log.delta_cov),
    )


def _corrected(
    stays: Constant, truth: Truth | None, drawn: Shown, before: tuple[NoiseCheck | None, NoiseCheck | None]
) -> Corrected | None:
    """The log without its errors that stay, in what these are most of; None where they are not."""
    log = stays.log
    places = None if drawn.places is None else placed(log, drawn.poses, drawn.pose_at(len(log)), known=True)
    seen, driven = _errors(log, truth, places)
    sightings, odometry = (
        after if one is not None and after is not None and after.median < LEFT * one.median else None
        for one, after in zip(before, _checks(log, seen, driven), strict=True)
    )
    if sightings is None and odometry is None:
        return None
    left = None if sightings is None or seen is None else measured(seen)
    return Corrected(tuple(sentences(stays.fit)), sightings, odometry, left)
