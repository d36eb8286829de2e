"""Tells a lens that is not the stated one by the corners of squares, against the errors stated for them.

By a wrong lens a square is no square, and the larger a marker is in the image, the less: so the largest tell. In
rendered frames of every lens and sensor the ratio below is 1 to 4 (7 with much chromatic aberration), in photographs
up to 7, as their calibration has errors, too. With a fisheye lens taken for another it is 20 to 32, and without a
lens's distortion 9 to 26, by the noise of the sensor.
"""

import numpy as np

from ...core.se2 import Array

FEWEST = 10  # sightings from which a share of them is judged
LARGEST = 0.25  # share of the sightings, by size in the image
WORSE, TYPICALLY = 10.0, 3.0  # ratio of errors, root mean square and median, from which the lens is not the stated one


class Misfit:
    """Collects the squares that a camera sees."""

    def __init__(self) -> None:
        self._rows = list[tuple[float, float, float]]()  # px: error, expected error, size

    def add(self, corners: Array, cov: Array, error: float) -> None:
        """Takes in one, with corners (4, 2) of covariance (8, 8), px, and their distance from its pose's, RMS, px."""
        across, along = corners[2] - corners[0], corners[3] - corners[1]
        # A pose has 6 parameters and corners 8 coordinates: of their variance a quarter is left, over 4 corners.
        expected = np.sqrt(np.trace(cov) / 16)
        size = np.sqrt(abs(across[0] * along[1] - across[1] * along[0]) / 2)
        self._rows.append((error, float(expected), float(size)))

    def remarks(self, name: str) -> list[str]:
        """The remark on corners that are no square's by this lens, if any."""
        if len(self._rows) < FEWEST:
            return []
        rows = np.array(self._rows)
        large = rows[rows[:, 2] >= np.quantile(rows[:, 2], 1 - LARGEST)]
        ratio = large[:, 0] / large[:, 1]
        worse = _rms(ratio)
        if not (worse > WORSE and np.median(ratio) > TYPICALLY):
            return []
        said = (
            f"{name}: the corners of large markers fit {worse:.0f} times worse than their patterns do "
            f"({_rms(large[:, 0]):.2g} px): perhaps the calibration is of another lens model, or of raw images where "
            "these are rectified"
        )
        return [said]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
