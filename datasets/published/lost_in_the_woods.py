"""Lost in the woods: a wheeled robot with a laser scanner among 17 tubes, with a true path and true places.

T. D. Barfoot, "State estimation for aerospace vehicles - AER1513 course assignments", utiasASRL/aer1513, the file
dataset2.mat: 12,609 rows at 10 Hz with the speeds v and om of the wheels, and for each tube its range r and bearing b
from the scanner, which sits d ahead of the robot's origin; r is 0 where a tube is not seen. The true path comes from
motion capture, and has no value where `true_valid` is 0.

Speeds are held from their row to the next: so they fit the true path, on which they would come a row late otherwise.
The file's variances are those of single errors. Errors of ranges and bearings stay correlated for more than a second,
so that backends that take them as they are stated are overconfident; `bench noise` says by how much.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Log, Map, Prior, Truth
from ...core.mounting import Mounting
from ...core.options import option
from ...core.se2 import Array, wrap
from ...frontend.wheels.encoder import roll
from ..hidden_ids import HiddenIds
from ..registry import Source
from .catalogue import fetched

FILE = "dataset2.mat"
COLUMNS = ("t", "v", "om", "x_true", "y_true", "th_true", "true_valid")
NUMBERS = ("d", "r_var", "b_var", "v_var", "om_var")

START_SD = 1e-2
"""Standard deviation of the start, m and rad: about that of single true poses."""


@dataclass(frozen=True)
class Options(HiddenIds):
    """The file, where the scanner sits, and the noise; what is not given is as the file has it."""

    path: str | None = option(None, "dataset2.mat or the folder that has it; not given: the copy from bench fetch")
    sensor_x: float | None = option(None, "m that the scanner sits ahead of the robot's origin", minimum=-9, maximum=9)
    sensor_delay: float = option(0.0, "s that its clock is late", minimum=-9, maximum=9)
    range_sd: float | None = option(None, "standard deviation of ranges, m", minimum=1e-6, maximum=9)
    bearing_sd: float | None = option(None, "standard deviation of bearings, rad", minimum=1e-6, maximum=3)
    speed_sd: float | None = option(None, "standard deviation of speeds ahead, m/s", minimum=1e-6, maximum=9)
    lateral_sd: float = option(0.01, "standard deviation of speeds to the side, m/s", minimum=1e-6, maximum=9)
    turning_sd: float | None = option(None, "standard deviation of turning rates, rad/s", minimum=1e-6, maximum=9)


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Lost in the woods: a robot with a laser, 12,609 steps, 61,086 sightings of 17 tubes, true path and map."""
    given = Path(options.path) if options.path else fetched("lost-in-the-woods", "lost-in-the-woods[path=FILE]")
    return read(given / FILE if given.is_dir() else given, options)


source = Source(make, Options)


def read(path: Path, options: Options) -> Dataset:
    """Reads the file; InputError names the variable that is missing or misshapen."""
    found = _variables(path)
    t, number = found["t"], {name: float(found[name][0]) for name in NUMBERS}
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        raise InputError(f"{path}: t[{back[0] + 1}] is {t[back[0] + 1]!s}, expected times that ascend.")
    r, b = found["r"], found["b"]
    step, tube = np.nonzero(r)
    dt = np.diff(t)
    delta = roll(np.column_stack((found["v"][:-1], found["om"][:-1])) * dt[:, None], "arc")[0]
    sds = (
        _or(options.speed_sd, number["v_var"]),
        options.lateral_sd,
        _or(options.turning_sd, number["om_var"]),
    )
    nothing = np.full((1, 3), np.nan)
    pose = np.column_stack([found[name] for name in ("x_true", "y_true", "th_true")])
    pose[:, 2] = wrap(pose[:, 2])
    valid = found["true_valid"] != 0
    if not valid[0]:
        raise InputError(f"{path}: true_valid[0] is 0, expected a true pose of the start.")
    z_sd = _or(options.range_sd, number["r_var"]), _or(options.bearing_sd, number["b_var"])
    place = number["d"] if options.sensor_x is None else options.sensor_x
    log = Log.from_arrays(
        "lost-in-the-woods",
        Prior(pose[0], START_SD**2 * np.eye(3)),
        t,
        np.concatenate((nothing, delta)),
        np.concatenate((np.full((1, 3, 3), np.nan), np.diag(np.square(sds)) * dt[:, None, None] ** 2)),
        step,
        tube,
        np.column_stack((r[step, tube], wrap(b[step, tube]))),
        np.broadcast_to(np.diag(np.square(z_sd)), (len(step), 2, 2)),
        sensor=Mounting(x=place, delay=options.sensor_delay),
        notes={
            "source": "T. D. Barfoot, AER1513 course assignments, utiasASRL/aer1513, dataset2.mat",
            "licence": "Apache-2.0",
            "sensor": {"x": place, "delay": options.sensor_delay},
        },
    )
    return Dataset(log, Truth(t[valid], pose[valid], Map(np.arange(len(found["l"])), found["l"], None)))


def _or(given: float | None, variance: float) -> float:
    return float(np.sqrt(variance)) if given is None else given


def _variables(path: Path) -> dict[str, Array]:
    """The variables of the file: columns (n,), numbers (1,), r and b (n, m), l (m, 2)."""
    from scipy.io import loadmat

    if not path.is_file():
        raise InputError(f"{path}: there is no such file, expected {FILE}.")
    try:
        held: dict[str, Any] = loadmat(path)
    except (OSError, ValueError, TypeError, NotImplementedError) as error:
        raise InputError(f"{path}: cannot be read as a MAT file: {str(error).splitlines()[0]}.") from None
    found = dict[str, Array]()
    for name in (*COLUMNS, *NUMBERS, "r", "b", "l"):
        if name not in held:
            raise InputError(f"{path}: found no variable {name}, expected one.")
        try:
            values = np.asarray(held[name], np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{path}: variable {name} has no numbers, expected numbers.") from None
        found[name] = values if name in ("r", "b", "l") else values.ravel()
    n, m = found["t"].size, found["l"].shape[0]
    shapes = dict.fromkeys(COLUMNS, (n,)) | dict.fromkeys(NUMBERS, (1,)) | {"r": (n, m), "b": (n, m), "l": (m, 2)}
    for name, shape in shapes.items():
        if found[name].shape != shape:
            was, wanted = ("x".join(map(str, one)) for one in (found[name].shape, shape))
            raise InputError(f"{path}: variable {name} is {was}, expected {wanted}.")
        if not np.isfinite(found[name]).all():
            raise InputError(f"{path}: variable {name} has a value that is not finite, expected numbers.")
    return found
