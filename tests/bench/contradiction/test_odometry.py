"""Odometry of another drive, and truth of another drive, are named, and not the landmarks that are right."""

from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.contradiction.odometry import blamed
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Truth

SEEDS = range(8)
WORLD = "aruco-robot[gyro=0.1]"


def of_another_drive(log: Log) -> Log:
    """With the motions of a drive that is this one backwards."""
    delta = log.delta.copy()
    delta[1:] = delta[:0:-1]
    return replace(log, delta=delta)


@pytest.mark.parametrize("seed", SEEDS)
def test_odometry_of_another_drive_is_named_by_truth_or_by_the_gyro(seed: int):
    log, truth = load(WORLD, seed)
    for known, words in ((truth, "not that of the true path"), (None, "turns are not the gyro's")):
        found = remarked(Dataset(of_another_drive(log), known))
        (said,) = found.contradictions
        assert words in said
        assert found.mistaken
        assert not found.outliers


@pytest.mark.parametrize("seed", SEEDS)
def test_wrong_ids_are_not_said_to_be_the_odometry_s(seed: int):
    """Neither are a gyro and a true path that agree with it."""
    log, truth = load(WORLD, seed)
    names = np.unique(log.ids)
    others = np.roll(names, 3)[np.searchsorted(names, log.ids)]
    renumbered = replace(log, ids=np.where(log.sighting_step > len(log) // 2, others, log.ids))
    for one in (log, renumbered):
        fits = remarked(Dataset(one, truth))
        assert not any("odometry" in said for said in fits.contradictions + fits.outliers)
        assert not blamed(Dataset(one, truth), [])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_true_path_of_another_drive_is_named_and_not_the_places(seed: int):
    """It is half a metre from the robot's, with the places of landmarks as sighted."""
    log, truth = load(WORLD, seed)
    assert truth is not None
    at, poses = np.linspace(0, 1, len(truth.t)), truth.poses.copy()
    poses[:, 0] += 0.4 * np.sin(9 * at)
    poses[:, 1] += 0.4 * np.cos(7 * at) - 0.4
    (said,) = remarked(Dataset(log, truth._replace(poses=poses))).contradictions
    assert "the true path is less precise than the sensor, or of another drive" in said
    assert said.endswith("and the true places of landmarks alone fit")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_path_and_places_that_each_fit_alone_are_both_named(seed: int):
    log, truth = load(WORLD, seed)
    assert truth is not None
    (said,) = remarked(Dataset(log, shifted(truth))).contradictions
    assert "do not belong together, as either alone fits" in said


def shifted(truth: Truth) -> Truth:
    return truth._replace(poses=truth.poses + np.array([0.3, 0.2, 0.0]))
