"""A made-up robot's files in MRCLAM's format, with all that those of the publisher have."""

import numpy as np

EPOCH = 1248444187.0
HEADER = "# UTIAS Multi-Robot Cooperative Localization and Mapping Dataset\n# a second line\n"


def rows(*table: tuple[float, ...]) -> str:
    """Rows whose first column is a time after EPOCH, with the originals' milliseconds and blanks."""
    return HEADER + "".join(f"{EPOCH + t:.3f} \t " + " \t ".join(map(repr, rest)) + " \n" for t, *rest in table)


SPEED, TURN = 0.5, 0.2
FILES = {
    "Barcodes.dat": HEADER + "  1 \t 5 \n  2 \t 14 \n  6 \t 63 \n  7 \t 81 \n",
    "Landmark_Groundtruth.dat": HEADER + "  6 \t 1.5 \t -2.5 \t 0.0001 \t 0.0002 \n  7 \t 3.0 \t 4.0 \t 0.1 \t 0.1 \n",
    # starts before the truth does, repeats a time, is silent for more than a second, and goes on after the truth ended
    "Robot1_Odometry.dat": rows(
        (0.0, 9.0, 9.0), (1.0, SPEED, 0.0), (1.5, 9.0, 9.0), (1.5, SPEED, TURN), (3.0, 0.0, 0.0), (4.4, SPEED, -TURN),
        (9.0, 1.0, 0.0),
    ),
    "Robot1_Measurement.dat": rows(
        (0.5, 63, 1.0, 0.1),  # before the log
        (2.25, 63, 2.0, 0.1), (2.25, 81, 3.0, -0.2), (2.25, 63, 2.1, 0.1),  # one of them twice
        (3.0, 14, 1.0, 0.0),  # another robot
        (3.5, 99, 1.0, 0.0),  # nobody
        (4.0, 81, 4.0, 0.3),  # on a full second of the log
        (7.5, 81, 4.0, 0.3),  # after the log
    ),
    # 10 Hz, turning through pi, with a gap from 3.5 to 4.2
    "Robot1_Groundtruth.dat": rows(
        *((0.8 + t, 0.1 * t, -t, float(np.arctan2(np.sin(3 + t / 10), np.cos(3 + t / 10)))) for t in
          (np.arange(53) / 10).tolist() if not 2.75 < t < 3.35)
    ),
}  # fmt: skip
