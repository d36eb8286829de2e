"""The wheels' word on the last half metre, where it contradicts what the scans were matched to.

Along a corridor few points tell how far the robot came. If they are on somebody who walks ahead of it, the matcher
follows them, and believes that it stands still; scan by scan, the wheels' prior is too weak to say no.
"""

from collections import deque

import numpy as np

from ...core.se2 import Array, between, compose, wrap

WAY, LONGEST = 0.5, 200
"""m between the ends of what is compared, by the wheels; scans at most: a robot may stand for hours."""

FAR = 3.0
"""Distance of the matcher's motion from the wheels', in standard deviations of theirs, from which on one is wrong."""


class WheelsCheck:
    """Poses by the matcher and by the wheels, of the last scans."""

    def __init__(self) -> None:
        self._wheels = np.zeros(3)  # (3,) since the first scan
        self._last = deque[tuple[Array, Array]](maxlen=LONGEST)  # by the matcher, and by the wheels

    def motion(self, pose: Array, motion: Array) -> tuple[Array, Array]:
        """Adds the wheels' motion (3,) since the last scan, which was taken at `pose` (3,) by the matcher.

        Returns the matcher's pose at the beginning of the last half metre, and the wheels' motion since then.
        """
        self._last.append((pose, self._wheels))
        self._wheels = compose(self._wheels, motion)
        while len(self._last) > 1 and np.hypot(*(self._last[1][1] - self._wheels)[:2]) >= WAY:
            self._last.popleft()
        start, then = self._last[0]
        return start, between(then, self._wheels)

    def forget(self) -> None:
        """Begins anew: the matcher's path has been corrected."""
        self._last.clear()


def contradicts(moved: Array, motion: Array, information: Array) -> bool:
    """Tells if the matcher moved (3,) otherwise than the wheels say, by the information (3, 3) of their motion."""
    off = moved - motion
    off[2] = wrap(off[2])
    return bool(off @ information @ off > FAR**2)
