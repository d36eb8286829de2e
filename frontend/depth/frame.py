"""A frame of a depth camera."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]
Depth = NDArray[np.float32]
"""(h, w) m along the optical axis, not along the ray; 0 where there is none."""


class DepthFrame(NamedTuple):
    """A grey image and the depth of its pixels."""

    seconds: float  # s, the middle of the exposure, by the clock of the wheels' readings
    grey: Grey  # (h, w)
    depth: Depth  # (h, w) registered to `grey`: of the same pixels
    colour: NDArray[np.uint8] | None = None  # (h, w, 3) BGR; None: the camera has grey images only
