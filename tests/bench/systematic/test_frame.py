"""A true path of another point or heading than the robot's wheels is told from a sensor that sits elsewhere."""

import numpy as np
import pytest

from planted_errors import drive, fit_of
from slamduel.bench.noise.measured import measured
from slamduel.bench.noise.words import rows, sentences
from slamduel.bench.systematic.frame import Frame, of_another, put_right
from slamduel.core.factors import Dataset
from slamduel.core.se2 import compose
from slamduel.datasets.noise.systematic import Systematic


def of_point(dataset: Dataset, *pose: float) -> Dataset:
    """With the true path of that point and heading in the robot's frame."""
    assert dataset.truth is not None
    return dataset._replace(truth=dataset.truth._replace(poses=compose(dataset.truth.poses, np.array(pose))))


@pytest.mark.parametrize(
    ("pose", "names", "words"),
    [
        ((0.3, 0.0, 0.0), {"x"}, "is that of a point 0.2"),
        ((0.0, -0.1, 0.08), {"y", "yaw"}, "to the right of the robot's origin and has a heading 4.5"),
    ],
)
def test_the_sensor_s_place_is_that_without_the_true_path(
    pose: tuple[float, float, float], names: set[str], words: str
) -> None:
    noise = measured([of_point(drive(Systematic(x=0.2), 1, seconds=60), *pose)], ["planted"])
    assert noise.frame is not None
    assert set(noise.frame.estimates) == names
    for at, name in zip(pose, ("x", "y", "yaw"), strict=True):
        if name in names:
            one = noise.frame.estimates[name]
            assert abs(one.value - at) <= one.high - one.low
    assert noise.model.systematic.x == pytest.approx(0.2, abs=0.02)
    assert noise.model.systematic.heading == 0
    said = sentences(noise)
    assert said[0].startswith("The true path likely ")
    assert words in said[0]
    assert len({row.name for row in rows(noise)}) == len(list(rows(noise)))


@pytest.mark.parametrize("errors", [Systematic(), Systematic(x=0.2, yaw=0.1, delay=0.1)])
def test_a_path_of_the_robot_is_left(errors: Systematic) -> None:
    assert measured([drive(errors, 2, seconds=60)], ["planted"]).frame is None


def test_motions_that_fit_the_true_path_as_it_is_keep_it() -> None:
    """Sightings alone are misled here, as by wrong ids: those of another log say that the sensor sits ahead."""
    dataset, other = drive(Systematic(x=-0.2), 1, seconds=60), drive(Systematic(x=0.2), 1, seconds=60)
    by_truth, alone = fit_of(dataset, by_truth=True), fit_of(other, by_truth=False)
    assert of_another(by_truth, alone) is not None
    assert put_right(dataset, by_truth, alone) is None


def test_the_start_goes_with_the_path_where_it_is_the_path_s() -> None:
    dataset = of_point(drive(Systematic(), 1, seconds=5), 0.3, 0.0, 0.1)
    frame = Frame(fit_of(drive(Systematic(x=0.3, yaw=0.1), 1), by_truth=True).estimates)
    moved = frame.put_right(dataset)
    assert moved.truth is not None
    assert moved.log is dataset.log
    start = dataset.log.prior.pose
    assert moved.truth.poses[0] == pytest.approx(start, abs=0.01)
    again = frame.put_right(drive(Systematic(), 1, seconds=5))
    assert again.truth is not None
    np.testing.assert_array_equal(again.log.prior.pose, again.truth.poses[0])
