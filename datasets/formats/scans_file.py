"""Scans beside a log of a laser scanner, for pictures: scans.npz, which backends never see.

    t (n,), ranges (n, b)                          s, m; every scan, between steps, too
    angles (b,), scanner (3,), limits (2,)         rad, counter-clockwise; on the robot; m, the least and largest return
    step (n,), before (n, 3), after (n, 3)         the last step at or before the scan; the robot's pose seen from that
                                                   step, and from the next one
    estimate (n, 3)                                the front end's own, in the prior's world

A step's own scan is the first one of that step, at the same pose. After the last step, `after` is `before`.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...frontend.errors import InputError
from ...frontend.files import replaced
from ...frontend.laser.front_end import FrontEnd
from ...frontend.laser.recording import LaserRecording, placed
from ...frontend.laser.scanner import Scanner
from ...frontend.se2 import Array, Ints, between, compose

NAME = "scans.npz"


class Scans(NamedTuple):
    """All scans of a log."""

    t: Array  # (n,) s, strictly increasing
    ranges: Array  # (n, b) m, in single precision on disk
    angles: Array  # (b,) rad
    scanner: Array  # (3,) its pose on the robot
    limits: Array  # (2,) m
    step: Ints  # (n,)
    before: Array  # (n, 3) the robot seen from that step
    after: Array  # (n, 3) and from the next one
    estimate: Array  # (n, 3)

    def poses(self, path: Array) -> Array:
        """The robot's pose (n, 3) at every scan where `path` (k, 3) is that of the steps.

        A scan between two steps is seen from both, and bent linearly from one to the other.
        """
        own = np.searchsorted(self.step, np.arange(len(path)))
        at = self.t[own]
        following = np.minimum(self.step + 1, len(path) - 1)
        share = np.clip((self.t - at[self.step]) / np.maximum(at[following] - at[self.step], 1e-9), 0.0, 1.0)
        one, other = compose(path[self.step], self.before), compose(path[following], self.after)
        return compose(one, between(one, other) * share[:, None])

    def points(self, row: int) -> Array:
        """The returns of a scan as points (k, 2) in the robot's frame, m."""
        return Scanner(self.angles, self.scanner, *self.limits.tolist()).points(self.ranges[row])


def scans_of(recording: LaserRecording, front_end: FrontEnd) -> Scans:
    """The scans of a recording that a front end has taken."""
    step = np.array(front_end.of_step)
    steps, path = np.array([one.pose for one in front_end.steps]), np.array(front_end.path)
    n, scanner = len(step), recording.scanner
    return Scans(
        t=recording.t[:n],
        ranges=recording.ranges[:n],
        angles=scanner.angles,
        scanner=scanner.pose,
        limits=np.array([scanner.least, scanner.most]),
        step=step,
        before=between(steps[step], path),
        after=between(steps[np.minimum(step + 1, len(steps) - 1)], path),
        estimate=placed(recording, front_end),
    )


def write_scans(folder: Path, scans: Scans) -> None:
    """Writes them to `folder`; OSError where that is impossible."""
    columns: dict[str, Any] = scans._asdict() | {"ranges": scans.ranges.astype(np.float32)}
    with replaced(folder / NAME, ".npz") as part:
        np.savez_compressed(part, **columns)


def read_scans(folder: Path, steps: int) -> Scans | None:
    """The scans of the log of that many steps in `folder`; None without a file of them.

    InputError for one that is damaged or of another log.
    """
    path = folder / NAME
    if not path.exists():
        return None
    try:
        with path.open("rb") as content, np.load(content, allow_pickle=False) as file:
            read = {name: np.asarray(file[name]) for name in Scans._fields}
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]}, expected {', '.join(Scans._fields)}.") from None
    except Exception as error:  # a damaged file may raise anything
        said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise InputError(f"{path}: is damaged or no file of scans ({said}).") from None
    n, b = len(np.atleast_1d(read["t"])), len(np.atleast_1d(read["angles"]))
    shapes = {"t": (n,), "ranges": (n, b), "angles": (b,), "scanner": (3,), "limits": (2,), "step": (n,)}
    shapes |= dict.fromkeys(("before", "after", "estimate"), (n, 3))
    for name, shape in shapes.items():
        kind = "i" if name == "step" else "f"
        if read[name].shape != shape or read[name].dtype.kind != kind:
            found = f"{read[name].dtype} of the shape {read[name].shape}"
            raise InputError(f"{path}: {name} is {found}, expected {'whole ' * (kind == 'i')}numbers of {shape}.")
        if name != "ranges" and not np.isfinite(read[name]).all():
            raise InputError(f"{path}: {name} has what is not a number, expected finite ones.")
    step, t = read["step"].astype(np.int64), read["t"].astype(np.float64)
    if not n or (np.diff(t) <= 0).any():
        raise InputError(f"{path}: found {n} scans whose times do not increase, expected them in the order of time.")
    if not np.array_equal(np.unique(step), np.arange(steps)) or (np.diff(step) < 0).any():
        raise InputError(
            f"{path}: its scans are of the steps {step.min()} to {step.max()}, expected each of the log's 0 to "
            f"{steps - 1}, in order."
        )
    numbers = {name: value.astype(np.float64) for name, value in read.items()}
    return Scans(**{**numbers, "step": step})  # pyright: ignore[reportArgumentType]
