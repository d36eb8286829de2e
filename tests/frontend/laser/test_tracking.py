"""Tracking where the wheels lie: scans decide between several guesses, if need be after some more of them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slamduel.core.se2 import between
from slamduel.datasets.worlds.laser_floor import Options, record
from slamduel.frontend.laser.recording import LaserRecording, matched
from slamduel.frontend.laser.scanner import Scan
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.laser.tracking import LONGEST, Placed, Tracker
from tiers import first_quick

FAULTS = ({"stalls": 12.0}, {"late_heading": 0.5}, {"stuck": 6.0}, {"spins": 6.0}, {"clock_stalls": 6.0})


def followed(seed: int, draw: int, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n, 3) of steps of a short drive, scans taken at once, a micrometre of noise, and NEES of each."""
    recording, truth = record(Options(laps=0.5, **options), np.random.default_rng(seed))
    noise = 1e-6 * np.random.default_rng(draw).standard_normal(recording.ranges.shape)
    front_end = matched(replace(recording, ranges=recording.ranges + noise), Settings(stamp_sd=0.0))
    true = truth.poses[[step.scan for step in front_end.steps]]
    errors = between(between(true[:-1], true[1:]), np.array([step.delta for step in front_end.steps[1:]]))
    cov = np.array([step.cov for step in front_end.steps[1:]])
    return errors, np.einsum("ni,nij,nj->n", errors, np.linalg.inv(cov), errors) / 3


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: next(iter(fault)))
@pytest.mark.parametrize("seed", first_quick(range(4)))
@pytest.mark.parametrize("draw", first_quick(range(4)))
def test_no_step_is_wrong_where_the_wheels_are(fault: dict[str, Any], seed: int, draw: int) -> None:
    errors, nees = followed(seed, draw, **fault)
    assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.15
    assert np.abs(errors[:, 2]).max() < 0.015  # 18 mrad where a scan that the wheels turn is matched once
    assert 0.5 < nees.mean() < 2


def test_scans_that_wait_for_a_decision_are_placed_at_the_end() -> None:
    recording, _ = record(Options(laps=0.3, stalls=12.0), np.random.default_rng(0))
    seen = list[tuple[int, int]]()
    front_end = matched(recording, Settings(), lambda one: seen.append((len(seen) + 1, len(one.t))))
    assert any(placed < taken for taken, placed in seen)
    assert len(front_end.t) == len(front_end.path) == len(recording.t)
    assert front_end.t == recording.t.tolist()
    taken = next(taken for taken, placed in seen if placed < taken)
    short = matched(_first(recording, taken), Settings())
    assert len(short.t) == taken


def _first(recording: LaserRecording, scans: int) -> LaserRecording:
    assert recording.odometry is not None
    return replace(
        recording, t=recording.t[:scans], ranges=recording.ranges[:scans], odometry=recording.odometry[:scans]
    )


def test_two_places_that_explain_alike_make_a_step_uncertain() -> None:
    tracker = Tracker(Settings())
    scan = Scan(np.zeros((0, 2)), 0.04)

    def branch(x: float, score: float) -> list[Placed]:
        return [Placed(float(k), scan, np.array([x, 0.0, 0.0]), 0.9, score, 0.0, True) for k in range(LONGEST)]

    tracker.branches = [branch(0.0, 0.9), branch(1.5, 0.9001)]
    placed = tracker.decide()
    assert [one.pose[0] for one in placed] == [1.5] * LONGEST
    assert placed[0].off == pytest.approx([-1.5, 0.0, 0.0])
    assert tracker.undecided == 1
    tracker.branches = [branch(0.0, 0.9), branch(1.5, 0.5)]
    assert tracker.decide()[0].off is None
