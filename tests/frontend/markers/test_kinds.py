"""A colour filter moves edges along the pixels and hides it from a fit: the stated covariance has it."""

from dataclasses import replace

import numpy as np
import pytest

from bayer_camera import CAMERA, COLOURS, PHASES, SIDE, Process, picture
from slamduel.frontend.markers._edges import BLURS, COLUMNS, KIND, KIND_SD, RESIDUAL, SIGNS, WEIGHT, part_kinds
from slamduel.frontend.markers._grey import PARAMETERS
from slamduel.frontend.markers.aruco import Detector
from slamduel.frontend.markers.markers import Markers
from tiers import first_quick

DETECTOR = Detector(Markers("4X4_50", SIDE), CAMERA)
SHARPENED = {"gamma": 2.2, "sharpen": 0.8}
LEVEL = 0.0  # rad, the roll of a marker that hangs level


def test_the_kinds_blurs_are_fitted_together_with_the_parameters() -> None:
    """As least squares over all thirty, after those over the twenty-four."""
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(400, COLUMNS))
    rows[:, WEIGHT], rows[:, KIND] = rng.uniform(0.3, 1, 400), rng.integers(4, size=400)
    signs = SIGNS[:, rows[:, KIND].astype(int)].T
    own = (signs[:, :, None] * rows[:, None, BLURS]).reshape(400, 6)
    plain, weights = rows[:, :PARAMETERS], rows[:, WEIGHT, None]
    rows[:, RESIDUAL] += 2 * own @ rng.normal(size=6)
    normal = plain.T @ (weights * plain)
    rows[:, RESIDUAL] -= plain @ np.linalg.solve(normal, plain.T @ (weights[:, 0] * rows[:, RESIDUAL]))
    both = np.hstack((plain, own))
    matrix = both.T @ (weights * both)
    matrix[PARAMETERS:, PARAMETERS:] += np.eye(6) / KIND_SD**2
    all_thirty = np.linalg.solve(matrix, both.T @ (weights[:, 0] * rows[:, RESIDUAL]))
    rest, hidden = rows[:, RESIDUAL] - both @ all_thirty, np.zeros(PARAMETERS)
    chi = part_kinds(rows, normal, 1.0, hidden)
    np.testing.assert_allclose(hidden, all_thirty[:PARAMETERS], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(rows[:, RESIDUAL], rest, rtol=1e-8, atol=1e-9)
    assert chi == pytest.approx(weights[:, 0] @ rest**2)


def test_without_a_filter_nothing_is_taken_out() -> None:
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(400, COLUMNS))
    rows[:, WEIGHT], rows[:, KIND] = 1.0, rng.integers(4, size=400)
    before, hidden = rows.copy(), np.zeros(PARAMETERS)
    assert np.isnan(part_kinds(rows, rows[:, :PARAMETERS].T @ rows[:, :PARAMETERS], 1.0, hidden))
    np.testing.assert_array_equal(rows, before)
    assert not hidden.any()


def hold(processes: list[Process], distance: float, count: int, roll: float, bias: float) -> None:
    """Most are found, none is wrong, distances are right to `bias` %, and NEES of the centre is in 0.5 to 2.

    `count` placements, by each of the `processes` in turn. A mean NEES over three dimensions varies by sqrt(2 / 3 n) of
    itself, a mean error by the errors' standard deviation over sqrt(n): three of them are allowed.
    """
    nees, far = list[float](), list[float]()
    for k in range(count):
        shot = picture(
            processes[k % len(processes)], distance, np.random.default_rng([round(1000 * distance), k]), roll
        )
        sightings, _ = DETECTOR.detect(shot.image)
        assert {sighting.id for sighting in sightings} <= {shot.id}
        for sighting in sightings:
            miss = sighting.centre - shot.centre
            nees.append(float(miss @ np.linalg.solve(sighting.centre_cov, miss)) / 3)
            far.append(100 * float(np.linalg.norm(sighting.centre) / np.linalg.norm(shot.centre) - 1))
    assert len(nees) >= 0.985 * count
    assert abs(np.mean(far)) < bias + 3 * np.std(far) / np.sqrt(len(far))
    chance = 3 * np.sqrt(2 / (3 * len(nees)))
    assert 0.5 * (1 - chance) < np.mean(nees) < 2 * (1 + chance)


def test_a_few_markers_that_hang_level_behind_a_colour_filter_are_as_good_as_stated() -> None:
    """By edges alone the NEES of these is 3.8: the filter moves edges all along, and their residuals do not tell."""
    hold([Process(phase, "opencv-ea") for phase in PHASES], 4.0, 24, LEVEL, 0.15)


@pytest.mark.slow
@pytest.mark.parametrize("roll", [LEVEL, 0.1, np.pi], ids=["level", "nearly level", "any"])
@pytest.mark.parametrize("look", [{}, SHARPENED], ids=["linear", "gamma and sharpening"])
@pytest.mark.parametrize("colours", COLOURS)
def test_markers_behind_a_colour_filter_are_as_good_as_stated(
    colours: str, look: dict[str, float], roll: float
) -> None:
    hold([replace(Process(phase, colours), **look) for phase in PHASES], 4.0, 200, roll, 0.15)


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_every_phase_of_a_colour_filter_is_as_good_as_stated(phase: str) -> None:
    hold([Process(phase, "opencv-ea")], 4.0, 200, LEVEL, 0.15)


@pytest.mark.parametrize(("distance", "count"), first_quick([(2.0, 20), (0.5, 40), (1.0, 100), (3.0, 200)]))
def test_without_a_colour_filter_markers_are_as_good_as_stated(distance: float, count: int) -> None:
    hold([Process()], distance, count, np.pi, 0.1)
