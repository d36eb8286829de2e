"""MRPT's EKF-SLAM, an implementation of the same filter in C++ (mrpt_ekf.cpp), compiled here against its library.

MRPT has no package for pip. Where its library, a compiler and CMake are, the filter is compiled on its first use, in
half a minute, and kept in the user's cache folder. It reads ranges and bearings in single precision.

Its cheaper method, Davison's, corrects by range and bearing one after the other, but takes the bearing's innovation
from before the range's correction (CKalmanFilterCapable_impl.h of MRPT 2.5.8).
"""

import ctypes
import hashlib
import os
import shutil
import subprocess
import sysconfig
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Map, Prior, Step
from ...core.files import cache_folder, replaced
from ...core.options import option
from ...core.se2 import Ints
from ..api import Belief, Builder, Diverged, Pose, Unsuited

SOURCE = Path(__file__).with_suffix(".cpp")
INSTALL = "apt-get install cmake g++ libmrpt-slam-dev"
PACKAGE = "cmake/mrpt-slam/mrpt-slam-config.cmake"
RECIPE = """\
cmake_minimum_required(VERSION 3.16)
project(mrpt_ekf CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(mrpt-slam REQUIRED)
add_library(mrpt_ekf SHARED "{source}")
target_link_libraries(mrpt_ekf mrpt::slam)
"""


@dataclass(frozen=True)
class Options:
    """Settings."""

    method: str = option(
        "naive",
        "update: naive, MRPT's default, by the sightings of a frame together, with full matrices; or davison, by one "
        "number after another",
        choices=("naive", "davison"),
    )


class MrptEkf:
    """MRPT's EKF-SLAM, in C++: landmarks with known ids, the whole covariance updated at each step."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        known = prior.map or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)
        self._numbers = {landmark: k for k, landmark in enumerate(known.ids.tolist())}  # MRPT's, by id
        self._library = library()
        davison = options.method == "davison"
        arrays = (davison, _array(prior.pose), _array(prior.cov), len(known.ids), _array(known.xy))
        self._filter = self._library.make(*arrays, None if known.cov is None else _array(known.cov))
        self._pose, self._cov = prior.pose.copy(), prior.cov.copy()

    def __del__(self) -> None:
        if hasattr(self, "_filter"):
            self._library.drop(self._filter)

    def step(self, step: Step) -> Pose:
        """Predicts, then corrects by the sightings; returns the pose (3,)."""
        seen, motion = step.sightings, step.odometry
        numbers = [self._numbers.setdefault(landmark, len(self._numbers)) for landmark in seen.ids.tolist()]
        self._pose, self._cov = np.empty(3), np.empty((3, 3))
        trouble = self._library.step(
            self._filter,
            None if motion is None else _array(motion.delta),
            None if motion is None else _array(motion.cov),
            len(numbers),
            _array(np.array(numbers, np.intc)),
            _array(seen.z),
            _array(seen.cov),
            self._pose.ctypes.data,
            self._cov.ctypes.data,
        )
        if trouble:
            raise Diverged(f"MRPT: {_message(self._library.why().decode(errors='replace'))}")
        if not np.isfinite(self._pose).all():
            raise Diverged("the latest pose is not finite")
        return self._pose.copy()

    def belief(self) -> Belief:
        """The latest pose and its covariance."""
        return Belief(self._pose.copy(), self._cov.copy())

    def map(self) -> Map:
        """The landmarks with their joint covariance."""
        n = self._library.landmarks(self._filter)
        numbers, xy, cov = np.empty(n, np.intc), np.empty((n, 2)), np.empty((2 * n, 2 * n))
        self._library.map(self._filter, numbers.ctypes.data, xy.ctypes.data, cov.ctypes.data)
        ids: Ints = np.fromiter(self._numbers, np.int64, len(self._numbers))
        return Map(ids[numbers], xy, cov if cov.any() else None)

    def finish(self) -> None:
        """None: a filter keeps no path."""


def _array(values: NDArray[Any]) -> Any:
    """The values in C's order, for an argument that is a pointer to them; it keeps them."""
    return np.ascontiguousarray(values).ctypes


def _message(said: str) -> str:
    """The line of MRPT's report on an exception that says what happened."""
    lines = said.strip().splitlines() or ["it says nothing"]
    return next((line for line in lines if line.startswith("Message:")), lines[0])


def lacking() -> str:
    """Says what is not installed, without compiling anything; "" if it can be compiled or has been."""
    tools = all(map(shutil.which, ("cmake", os.environ.get("CXX", "c++"))))
    if tools and any((place / PACKAGE).is_file() for place in _places()):
        return ""
    return f"MRPT's library is not installed with CMake and a C++ compiler; {INSTALL} does it on Debian and Ubuntu"


def _places() -> Iterator[Path]:
    """Folders in which CMake finds packages."""
    for prefix in (*os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep), "/usr", "/usr/local"):
        if prefix:
            yield from (Path(prefix, "lib"), Path(prefix, "share"))
            yield Path(prefix, "lib", sysconfig.get_config_var("MULTIARCH") or "")


@cache
def library() -> ctypes.CDLL:
    """Loads the compiled filter, and compiles it first where it is not in the cache; Unsuited with the reason."""
    made = cache_folder() / "programs" / f"mrpt_ekf-{_key()}.so"
    try:
        if not made.is_file():
            made.parent.mkdir(parents=True, exist_ok=True)
            _compile(made)
        found = ctypes.CDLL(str(made))
    except OSError as error:
        raise Unsuited(f"MRPT's filter cannot be compiled: {error}") from None
    pointer, number = ctypes.c_void_p, ctypes.c_int
    found.why.restype = ctypes.c_char_p
    found.make.restype, found.make.argtypes = pointer, [number, pointer, pointer, number, pointer, pointer]
    found.drop.restype, found.drop.argtypes = None, [pointer]
    found.step.argtypes = [pointer, pointer, pointer, number, *[pointer] * 5]
    found.landmarks.argtypes = [pointer]
    found.map.restype, found.map.argtypes = None, [pointer] * 4
    return found


def _key() -> str:
    """Names the source, and the library that it was compiled against."""
    total = hashlib.sha256(SOURCE.read_bytes() + RECIPE.encode())
    for place in _places():
        for file in sorted((place / PACKAGE).parent.glob("*version.cmake")):
            total.update(file.read_bytes())
    return total.hexdigest()[:16]


def _compile(made: Path) -> None:
    """Compiles into a folder of its own, and moves the result to its place. Unsuited: with the compiler's last line."""
    with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
        place, build = Path(folder), Path(folder) / "build"
        (place / "CMakeLists.txt").write_text(RECIPE.format(source=SOURCE.as_posix()))
        for arguments in (["-S", place, "-B", build, "-DCMAKE_BUILD_TYPE=Release"], ["--build", build]):
            done = subprocess.run(["cmake", *arguments], capture_output=True, text=True, errors="replace", check=False)
            if done.returncode:
                said = (done.stdout + done.stderr).strip().splitlines()
                raise Unsuited(f"MRPT's filter cannot be compiled: {said[-1] if said else 'CMake said nothing'}")
        with replaced(made) as part:
            shutil.copy(build / "libmrpt_ekf.so", part)


build = Builder(MrptEkf, options=Options, implementation="MRPT, compiled here", lacks=lacking)
