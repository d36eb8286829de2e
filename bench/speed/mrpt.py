"""Times MRPT's EKF-SLAM, a well-known implementation of the same filter, where MRPT is installed.

MRPT comes as a C++ library, with no package for pip: `mrpt_ekf.cpp` is compiled against it for the run. It times the
filter's step alone; the filter's input messages are made outside of the clock.
"""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.factors import Step
from .timing import TimingRow, timing
from .world import SIGHTING_SD, World

NAME = "MRPT's EKF"
NOT_INSTALLED = "not installed; it takes libmrpt-slam-dev (Debian, Ubuntu), cmake and a C++ compiler"
SOURCE = Path(__file__).with_name("mrpt_ekf.cpp")
GIVEN_UP = 3  # the program's exit status where the survey takes too long

RECIPE = """\
cmake_minimum_required(VERSION 3.16)
project(mrpt_ekf CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(mrpt-slam REQUIRED)
file(WRITE "${{CMAKE_BINARY_DIR}}/version" "${{mrpt-slam_VERSION}}")
add_executable(mrpt_ekf "{source}")
target_link_libraries(mrpt_ekf mrpt::slam)
"""


class Program(NamedTuple):
    """The compiled program, or why there is none."""

    path: Path | None
    version: str
    reason: str


def built(folder: Path) -> Program:
    """Compiles the program into `folder`; half a minute where MRPT is installed, else a second or two."""
    cmake, build = shutil.which("cmake"), folder / "build"
    if cmake is None:
        return Program(None, "", NOT_INSTALLED)
    (folder / "CMakeLists.txt").write_text(RECIPE.format(source=SOURCE.as_posix()))
    ways = {NOT_INSTALLED: ["-S", folder, "-B", build, "-DCMAKE_BUILD_TYPE=Release"], "": ["--build", build]}
    for reason, arguments in ways.items():
        done = subprocess.run([cmake, *arguments], capture_output=True, text=True, errors="replace", check=False)
        if done.returncode:
            return Program(None, "", reason or f"its program cannot be compiled: {_last(done.stdout + done.stderr)}")
    return Program(build / "mrpt_ekf", (build / "version").read_text().strip(), "")


def mrpt_row(program: Program, here: World, seconds: float, patience: float) -> TimingRow:
    """Times its steps of the drive until `seconds` are spent; a survey is given up after `patience`, s."""
    size = len(here.map.ids)
    if program.path is None:
        return TimingRow("together", NAME, size, reason=program.reason)
    text = "\n".join([f"{len(here.survey)} {len(here.drive)} {SIGHTING_SD[0]} {SIGHTING_SD[1]}", *_lines(here)])
    command = [str(program.path), f"{seconds}", f"{patience}"]
    done = subprocess.run(command, input=text, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        reason = f"it ended with status {done.returncode}: {_last(done.stderr)}"
        if done.returncode == GIVEN_UP:
            reason = f"its map was not made within {patience:g} s of CPU"
        return TimingRow("together", NAME, size, reason=reason)
    ns = np.array([int(line) for line in done.stdout.splitlines()[:-1]])  # the last line is the pose
    return TimingRow("together", NAME, size, timing=timing(ns), implementation=f"MRPT {program.version}".strip())


def _lines(here: World) -> Iterator[str]:
    """Yields one line per step, survey and drive, as the program reads them."""
    for step in (*here.survey, *here.drive):
        yield " ".join(map(str, (*_motion(step), len(step.sightings.ids), *_sightings(step))))


def _motion(step: Step) -> list[float]:
    """The motion, and the upper triangle of its covariance."""
    if step.odometry is None:
        return [0.0] * 9
    return [*step.odometry.delta.tolist(), *step.odometry.cov[np.triu_indices(3)].tolist()]


def _sightings(step: Step) -> Iterator[float]:
    for landmark, z in zip(step.sightings.ids.tolist(), step.sightings.z.tolist(), strict=True):
        yield from (landmark, *z)


def _last(text: str) -> str:
    return (text.strip().splitlines() or ["it said nothing"])[-1]
