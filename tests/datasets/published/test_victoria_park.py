"""Victoria Park: the file that `tests/datasets/formats/test_gtsam_text.py` compares with GTSAM's own reader."""

import numpy as np
import pytest

from slamduel.core.factors import Dataset, Log
from slamduel.datasets.published import victoria_park


def made(**options: float) -> Dataset:
    return victoria_park.source.make(victoria_park.Options(**options), np.random.default_rng(0))  # pyright: ignore[reportArgumentType]


@pytest.fixture(scope="module")
def log() -> Log:
    return made().log


def test_the_log_is_what_it_was(log: Log):
    """Results that were published with it stay comparable: the factors are these, bit for bit."""
    assert log.digest == "e93839eeeb58d76b382aad65e6cb2b3e6a42701fc287fef39089c72f245e5aff"
    assert log.name == "victoria-park"
    assert "University of Sydney" in log.notes["source"]


def test_odometry_can_be_stated_less_sure_than_the_file_does(log: Log) -> None:
    wider, truth = made(odometry_sd=5.0)
    assert truth is None
    assert np.array_equal(wider.delta_cov, 25 * log.delta_cov, equal_nan=True)
    assert np.array_equal(wider.delta, log.delta, equal_nan=True)
    assert np.array_equal(wider.z_cov, log.z_cov)
