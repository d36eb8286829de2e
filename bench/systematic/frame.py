"""A true path of another point on the robot, or of another heading, than those of its wheels.

Sightings and motions together tell where the sensor sits without it. Where that and the true path contradict each
other, and the motions fit the path better once it is moved by what they differ, it is the path that is elsewhere.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.factors import Dataset
from ...core.se2 import Array, act, compose, inverse
from ...datasets.noise.systematic import corrected
from .estimated import Estimated
from .fit import SystematicFit, fitted, of_truth
from .motions_along import SURE, Unlike, ratio, unlike
from .system import System

PLACE = ("x", "y", "yaw")

SAME = 1e-6
"""m and rad between the log's start and that of its true path, where it starts there."""


class PutRight(NamedTuple):
    """A true path that was of another point or heading, and what follows once it is the robot's own."""

    frame: "Frame"
    dataset: Dataset
    fit: SystematicFit


class Frame(NamedTuple):
    """The point and heading of a true path, in the frame of the robot's wheels."""

    estimates: Mapping[str, Estimated]  # of PLACE, those that differ from 0

    @property
    def pose(self) -> Array:
        """(3,) in the robot's frame."""
        return np.array([self.estimates[name].value if name in self.estimates else 0.0 for name in PLACE])

    def put_right(self, dataset: Dataset) -> Dataset:
        """The log and its true path with this point and heading as those of the robot's wheels."""
        log, truth = dataset
        if truth is None or not len(truth.t):
            return dataset
        moved = truth._replace(poses=compose(truth.poses, inverse(self.pose)))
        start = log.prior.pose
        if truth.t[0] != log.t[0] or np.abs(start - truth.poses[0]).max() > SAME:
            return Dataset(log, moved)
        return Dataset(replace(log, prior=log.prior._replace(pose=moved.poses[0])), moved)


def put_right(dataset: Dataset, by_truth: SystematicFit, alone: SystematicFit) -> PutRight | None:
    """Moves the true path by what both fits differ, and fits anew; None where motions do not fit it better then."""
    frame = of_another(by_truth, alone)
    if frame is None:
        return None
    moved = frame.put_right(dataset)
    before, after = of_truth(*dataset), of_truth(*moved)
    fit = None if after is None else fitted([after])
    if before is None or after is None or fit is None:
        return None
    better = ratio(_unlike(after, fit), _unlike(before, by_truth))
    return PutRight(frame, moved, fit) if better > SURE else None


def _unlike(system: System, fit: SystematicFit) -> Unlike:
    """Motions without the wheels' errors against the path; along its own heading a robot on wheels drives."""
    return unlike(corrected(system.log, fit.errors._replace(heading=0.0)), system.path, system.driven)


def of_another(by_truth: SystematicFit, alone: SystematicFit) -> Frame | None:
    """Returns the true path's point and heading, as those without it have the sensor; None where they agree.

    They differ where that is more than both intervals together.
    """
    places, sizes = np.zeros((2, 3)), np.zeros((2, 3))
    for k, fit in enumerate((by_truth, alone)):
        for axis, name in enumerate(PLACE):
            if name in fit.estimates:
                one = fit.estimates[name]
                places[k, axis], sizes[k, axis] = one.value, (one.high - one.low) / 2
    told = [all(name in fit.estimates for fit in (by_truth, alone)) for name in PLACE]
    half = np.hypot(*sizes)
    found = np.zeros(3)
    found[2] = places[1, 2] - places[0, 2]
    found[2] *= told[2] and abs(found[2]) > half[2]
    found[:2] = places[1, :2] - act(np.array([0.0, 0.0, found[2]]), places[0, :2])
    differs = np.abs(found) > half
    estimates = {
        name: Estimated(value, value - size, value + size)
        for name, value, size, known, differ in zip(PLACE, found.tolist(), half.tolist(), told, differs, strict=True)
        if known and differ
    }
    return Frame(estimates) if estimates else None
