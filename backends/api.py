"""The contract between the runner and an estimator: all that a plug-in imports.

A backend is a class with four methods, and a `Builder` that says how to make one:

    class Mine:
        def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None: ...
        def step(self, step: Step) -> Pose | None: ...
        def belief(self) -> Belief | None: ...
        def map(self) -> Map: ...
        def finish(self) -> Solution | None: ...

    build = Builder(Mine, options=Options)

It runs as `bench run --backend my_package.my_module:build`, or by a short name once its distribution declares the entry
point `[project.entry-points."slamduel.backends"] mine = "my_package.my_module:build"`. `bench check` holds it to the
same rules as the backends that come with slamduel.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from ..frontend.errors import SlamduelError
from ..frontend.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, RelativePoses, Step, Truth
from ..frontend.options import NoOptions, option
from ..frontend.se2 import Array, Ints, act, act_jacobians, between, compose, compose_jacobians, wrap

__all__ = [
    "COMPILED_HERE", "GTSAM_WHEEL", "UNKNOWN", "Array", "Backend", "Belief", "Builder", "Diverged", "Ints", "Map",
    "NoOptions", "Odometry", "Pose", "Prior", "RangeBearing", "RelativePoses", "Solution", "Step", "Truth",
    "TruthWanted", "WantsTruth", "act", "act_jacobians", "between", "compose", "compose_jacobians", "option", "wrap",
]  # fmt: skip

COMPILED_HERE = "compiled here"
"""Of a backend whose inner loops are kernels of this package, compiled for the processor that it runs on."""

GTSAM_WHEEL = "GTSAM's wheel"
"""Of a backend on GTSAM as its publisher compiled it, for any processor, each call going through Python."""

Pose = Array
"""(3,) x, y (m), heading (rad) in (-pi, pi]."""


class Belief(NamedTuple):
    """What a backend thinks after a step; what it does not know is None."""

    pose: Pose
    cov: Array | None = None  # (3, 3) of (x, y, heading) in the world frame
    nis: float | None = None  # normalised innovation squared of the step's sightings, summed
    nis_dof: int = 0  # degrees of freedom of nis: 2 for each sighting that has an innovation
    n_eff: float | None = None  # effective number of particles
    ancestors: int | None = None  # how many of the particles at the start the present ones descend from
    refused: int = 0  # sightings of the step that a gate kept out
    assigned: Ints | None = None  # (k,) the landmark each sighting of the step was taken for


class Solution(NamedTuple):
    """What a smoother thinks of the whole log once it is over."""

    path: Array  # (n, 3) a pose a step
    map: Map
    cov: Array | None = None  # (n, 3, 3) of each pose, in the world frame


@runtime_checkable
class Backend(Protocol):
    """An estimator in the middle of a log. Each method is timed on its own; nothing hides in an untimed call.

    What a method has returned is the caller's: it must not change when the backend goes on. The arrays of a step and of
    the prior are read-only. A backend that is handed a map keeps to it: held fixed where it has no covariance.
    """

    def step(self, step: Step) -> Pose | None:
        """Fold `step` in and return the pose it implies; None from a batch method, which has no online estimate."""
        ...

    def belief(self) -> Belief | None:
        """The belief after the last step, around the pose that it returned; None from a batch method.

        Asking must not change any later answer, not even in its last bit.
        """
        ...

    def map(self) -> Map:
        """The landmarks as known after the last step."""
        ...

    def finish(self) -> Solution | None:
        """The log is over: the smoothed path and map, or None from a filter."""
        ...


@runtime_checkable
class WantsTruth(Protocol):
    """A backend that can be told the truth, for a study of what it would do if it linearised there.

    `bench run --oracle` tells it, openly, and marks the rows of those that used it; without that flag nobody does.
    """

    def tell(self, truth: Truth) -> bool:
        """Take the truth of the log, before its first step; whether this backend, with its options, makes use of it."""
        ...


class TruthWanted(SlamduelError):
    """Raised by a backend whose options need the truth, at its first step without; its cell ends as `skipped`."""


class Diverged(SlamduelError):
    """Raised by a backend whose numbers left the domain on which it is defined; its cell ends as `diverged`."""


@dataclass(frozen=True)
class Builder:
    """How a backend is made, and what the runner must know of it before.

    `make(prior, options, rng)` returns a fresh backend; `options` is a frozen dataclass made with `option(...)` fields.
    `random`: it draws from `rng`, so it is run once a seed even where the log is always the same. `loops`: it takes
    RelativePoses factors; a log that has some is skipped for a backend that does not. `associates`: it finds landmarks
    for sightings with id UNKNOWN by itself; for the others these are taken out of the log, and counted. `forgets`: it
    lets go of landmarks that are long out of view, so that it does not close loops. `linear`: it takes the models for
    linear at a heading that is not its estimate, and where that heading is off is held to dead reckoning's bound alone.
    `implementation`: whose program does the work, in two or three words for tables, such as "compiled here" or "GTSAM's
    wheel"; a function of the options where they choose between programs. A cost is one of an implementation as much as
    of an algorithm. A builder that does not say is listed under the distribution that it comes from.
    """

    make: Callable[[Prior, Any, np.random.Generator], Backend]
    options: type = NoOptions
    random: bool = False
    loops: bool = False
    associates: bool = False
    forgets: bool = False
    linear: bool = False
    implementation: str | Callable[[Any], str] = ""

    def implemented(self, options: Any) -> str:
        """Whose program does the work with these options; "" where the builder does not say."""
        return self.implementation if isinstance(self.implementation, str) else self.implementation(options)

    @property
    def summary(self) -> str:
        """The first line of the maker's docstring."""
        return (self.make.__doc__ or "").strip().partition("\n")[0]
