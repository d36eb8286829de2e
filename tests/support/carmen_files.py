"""Laser logs written in CARMEN's formats."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np

from slamduel.core.se2 import Array
from slamduel.frontend.laser.recording import LaserRecording


def flaser(t: float, ranges: Array, pose: Array) -> str:
    words = " ".join(f"{r:.2f}" for r in ranges)
    place = " ".join(f"{x:.17g}" for x in pose)
    return f"FLASER {len(ranges)} {words} {place} {place} {t:.9f} host {t:.9f}"


def robotlaser(t: float, ranges: Array, pose: Array) -> str:
    words = " ".join(f"{r:.2f}" for r in ranges)
    place = " ".join(f"{x:.17g}" for x in pose)
    step = np.pi / (len(ranges) - 1)
    return (
        f"ROBOTLASER1 0 {-np.pi / 2:.17g} {np.pi:.17g} {step:.17g} 81.9 0.01 0 {len(ranges)} {words} 1 7 {place} "
        f"{place} 0.5 0 0.3 0.2 1e6 {t:.9f} host {t:.9f}"
    )


def written(path: Path, drive: LaserRecording, line: Callable[[float, Array, Array], str] = flaser) -> Path:
    assert drive.odometry is not None
    rows = [line(*one) for one in zip(drive.t.tolist(), drive.ranges, drive.odometry, strict=True)]
    text = "\n".join(("# a log", "PARAM robot_width 0.5", *rows, ""))
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path
