"""A recorded sequence of a hand-held Kinect: does every pair match, and how close is it?"""

import numpy as np
import pytest

from redkitchen import FOLDER, judged
from slamduel.frontend.depth.settings import Settings

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="no recording of the red kitchen")


@pytest.mark.parametrize(
    "frames", [range(0, 90, 3), pytest.param(range(0, 600, 3), marks=pytest.mark.slow)], ids=["first", "all"]
)
def test_no_pair_is_lost_and_half_of_them_are_close(frames: range) -> None:
    off = judged(frames, Settings())
    assert np.isfinite(off).all()
    metres, degrees = np.median(off, axis=0)
    assert metres < 0.007
    assert degrees < 0.25
