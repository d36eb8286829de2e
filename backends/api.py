"""The interface between the runner and an estimator: all that a plug-in imports.

A backend is a class with four methods, and a `Builder` that makes one:

    class Mine:
        def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None: ...
        def step(self, step: Step) -> Pose | None: ...
        def belief(self) -> Belief | None: ...
        def map(self) -> Map: ...
        def finish(self) -> Solution | None: ...

    build = Builder(Mine, options=Options)

`prior.loops` says that the log has loop closures, so that a filter may keep earlier poses on such logs alone.
`prior.start` is "known" unless the builder says `locates=True`: a robot that may be anywhere on `prior.map` is found
first, and the backend is made with the pose found. With `locates=True`, "unknown" says that pose and cov are
placeholders, and `Belief(located=False)` that the robot is not found yet.

It runs as `bench run --backend my_package.my_module:build`, or by a short name once its distribution declares the entry
point `[project.entry-points."slamduel.backends"] mine = "my_package.my_module:build"`. `bench check` tests it by the
same rules as the backends that come with slamduel.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np

from ..core.errors import SlamduelError
from ..core.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, RelativePoses, Step, Systematic, Truth
from ..core.fixes import Fixes
from ..core.gyro import Bias, Turn
from ..core.options import NoOptions, option
from ..core.partial import BEARING, RANGE, Partial
from ..core.se2 import Array, Ints, act, act_jacobians, between, compose, compose_jacobians, wrap
from ..core.signatures import Signatures

__all__ = [
    "BEARING", "COMPILED_HERE", "GTSAM_WHEEL", "RANGE", "UNKNOWN", "Array", "Associates", "AssociatesPartial",
    "Backend", "Belief", "Bias", "Builder", "Calibrates", "Calibration", "Constant", "Diverged", "Expected",
    "Expects", "Fixes", "Foresees", "Ints", "Map", "NoOptions", "Odometry", "Partial", "Pose", "Prior",
    "RangeBearing", "RelativePoses", "Signatures", "Solution", "Step", "Systematic", "TakenOut", "TakesOut",
    "Truth", "TruthWanted", "Turn", "Unites", "Unsuited", "WantsTruth", "act", "act_jacobians", "between",
    "compose", "compose_jacobians", "option", "wrap",
]  # fmt: skip

COMPILED_HERE = "compiled here"
"""Implementation of backends whose inner loops are this package's kernels, compiled for the local processor."""

GTSAM_WHEEL = "GTSAM's wheel"
"""Implementation of backends on GTSAM as published, compiled for any processor, each call through Python."""

Pose = Array
"""(3,) x, y (m), heading (rad) in (-pi, pi]."""


class Belief(NamedTuple):
    """A backend's estimate after a step; unknown values are None."""

    pose: Pose
    cov: Array | None = None  # (3, 3) of (x, y, heading) in the world frame
    nis: float | None = None  # normalised innovation squared of the step's sightings and loop closures, summed
    nis_dof: int = 0  # degrees of freedom of nis: of a sighting 2, or 3 if its signature is in it; of a loop closure 3
    n_eff: float | None = None  # effective number of particles
    ancestors: int | None = None  # number of initial particles with living descendants
    refused: int = 0  # sightings and loop closures of the step rejected by a gate
    assigned: Ints | None = None  # (k,) data association: landmark of each sighting of the step
    located: bool = True  # False: the start is unknown, and the robot has not been found on the map yet
    left_out: int = 0  # loop closures of the step that were not used: they are to poses that are no longer kept


class Constant(NamedTuple):
    """Estimated constant errors of the log's sensors: see `Systematic`. One that the prior has not is 0."""

    range_scale: Array  # (1,), or (n,) of each landmark of the map
    range_offset: Array  # m; likewise
    heading_offset: float = 0.0  # rad
    wheel_scale: float = 0.0
    sd: "Constant | None" = None  # their standard deviations, in the same shapes; None: not known


class Solution(NamedTuple):
    """The estimate of the whole log at its end, by a smoother, or a filter that keeps its path in its state."""

    path: Array  # (n, 3) one pose per step
    map: Map
    cov: Array | None = None  # (n, 3, 3) of each pose, in the world frame
    converged: bool | None = None  # False: the optimisation ended before its criterion was met; None: not known
    remark: str = ""  # on how it was found, for the cell's reason
    constant: Constant | None = None  # None: not estimated; its J is then the least over them
    gyro_bias: Bias | None = None  # at the end; likewise


@runtime_checkable
class Backend(Protocol):
    """An estimator in the middle of a log. Each method is timed on its own; nothing hides in an untimed call.

    Returned arrays belong to the caller: the backend must not change them later. The arrays of a step and of the prior
    are read-only. A given map is kept: held fixed where it has no covariance.
    """

    def step(self, step: Step) -> Pose | None:
        """Processes `step` and returns the pose estimate; None from a batch method, which has no online estimate."""
        ...

    def belief(self) -> Belief | None:
        """The belief after the last step, around the pose it returned; None from a batch method.

        Calling it must not change any later result, not even in the last bit.
        """
        ...

    def map(self) -> Map:
        """The map after the last step."""
        ...

    def finish(self) -> Solution | None:
        """Ends the log: returns the smoothed path and map, or None from a filter that keeps no path."""
        ...


@runtime_checkable
class WantsTruth(Protocol):
    """A backend that can be given ground truth, to study linearisation at the true state.

    Only `bench run --oracle` gives it, and marks the rows of backends that used it.
    """

    def tell(self, truth: Truth) -> bool:
        """Takes the log's ground truth before its first step; returns False if these options do not use it."""
        ...


class Expected(NamedTuple):
    """The landmarks that a backend expects to see at a step, before it processes the step's sightings."""

    ids: Ints  # (n,)
    z: Array  # (n, 2) range (m), bearing (rad)
    cov: Array  # (2n, 2n) joint, of all z, from the uncertainty of pose and map: without the sensor's noise


@runtime_checkable
class Expects(Protocol):
    """A backend that data association can stand in front of: see `association.layer`. Its maker is its class."""

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """The landmarks with which one of the sightings `seen` at the next step, after `odometry`, is compatible.

        Compatible is a squared Mahalanobis distance below `gate`; the ids of `seen` are not to be used. Asking changes
        no later result, not even in the last bit.
        """
        ...


@runtime_checkable
class Foresees(Protocol):
    """A backend with a gyro's bias in its state, and with the method of `Expects`, that expects by the turns too."""

    def foresee(self, turn: Turn | None) -> None:
        """Takes the next step's turn: until that step `expected` is to count with it beside the odometry.

        It changes no later result otherwise, not even in the last bit. A backend without this method expects by the
        odometry alone.
        """
        ...


@runtime_checkable
class Unites(Protocol):
    """A backend, with the method of `Expects`, that learns that landmarks are one: it may do so at any step's end."""

    def unite(self, pairs: list[tuple[int, int]]) -> Pose:
        """Takes the first landmark of each pair for the second, and returns the last step's pose by that.

        The first is not sighted again. Its map may still have it.
        """
        ...


@runtime_checkable
class Associates(Protocol):
    """A backend that decides which landmark each sighting is of, and may do so after the step."""

    def assigned(self) -> Ints:
        """(s,) the landmark of every sighting so far; UNKNOWN for one that is not used, or not decided on."""
        ...


@runtime_checkable
class AssociatesPartial(Protocol):
    """A backend that decides which landmark each partial sighting is of."""

    def assigned_partial(self) -> Ints | None:
        """(p,) the landmark of every partial sighting so far; UNKNOWN for one that is not used, or not decided on."""
        ...


class Calibration(NamedTuple):
    """A filter's estimates of what a `Solution` has too."""

    constant: Constant | None = None  # those of ranges are of all landmarks, or of each of `map()`
    gyro_bias: Bias | None = None


@runtime_checkable
class Calibrates(Protocol):
    """A backend that estimates constant errors along the way; one with a `Solution` that has them need not be."""

    def calibration(self) -> Calibration:
        """The estimates at present. The runner asks once, after the last step and `finish`, and takes no time of it."""
        ...


class TakenOut(NamedTuple):
    """The measurements taken out of a log on the way to a backend."""

    moved: Ints  # (m,) ids of landmarks that have moved
    misread: int  # sightings of other landmarks that were not used: their ids are wrong


@runtime_checkable
class TakesOut(Protocol):
    """A backend that takes out landmarks that move: see `association.standing`."""

    def taken_out(self) -> TakenOut | None:
        """The measurements that it has taken out so far; None if these options take nothing out."""
        ...


class TruthWanted(SlamduelError):
    """Raised at the first step by a backend whose options need ground truth; its cell ends as `skipped`."""


class Unsuited(SlamduelError):
    """Raised, when it is made, by a backend that cannot run on such a log; its cell ends as `skipped`."""


class Diverged(SlamduelError):
    """Raised by a backend whose estimate left the domain of its equations; its cell ends as `diverged`."""


@dataclass(frozen=True)
class Builder:
    """Makes a backend, and declares its properties to the runner.

    A class with the method of `Expects` gets options of data association, and the layer that does it in front of it.
    """

    make: Callable[[Prior, Any, np.random.Generator], Backend]
    """Returns a fresh backend from a prior, options and a generator of random numbers."""

    options: type = NoOptions
    """A frozen dataclass made with `option(...)` fields."""

    random: bool = False
    """It draws from its generator, so it runs once per seed even on a fixed log."""

    loops: bool = False
    """It uses RelativePoses factors, and `prior.loops` says where there are some; see also `leaves_out_loops`.

    Without, logs that have some are skipped.
    """

    sightings: bool = True
    """It uses sightings."""

    partial: bool = False
    """It uses sightings that tell a range or a bearing alone, and `prior.partial` says if there are some.

    Without, logs that have some are skipped, unless `leaves_out` names them.
    """

    fixes: bool = False
    """It uses fixes: positions, headings and poses measured in the world; `prior.fixes` says if there are some.

    Without, logs that have some are skipped, unless `leaves_out` names them.
    """

    gyro: bool = False
    """It takes the turns of a gyro, with the bias in its state, and `prior.gyro` is the belief about it.

    Its option `gyro`, if it has one, may ask for another treatment: see `common_options.gyro`. Without, turns are fused
    with the odometry in front of it.
    """

    wheel_scale: bool = False
    """It estimates the wheels' scale of `prior.systematic`. Without, it takes the odometry as it is, which is said."""

    leaves_out: tuple[Literal["partial", "fixes"], ...] = ()
    """Kinds of factors that it runs without, which are counted: it would make nothing of them."""

    associates: bool | Callable[[Any], bool] = False
    """It does data association for sightings with id UNKNOWN, always or with some options.

    Otherwise these are removed from the log, and counted.
    """

    associates_partial: Callable[[Any], bool] | None = None
    """Its data association is of partial sightings too, with some options; else those UNKNOWN are left out."""

    locates: bool = False
    """It finds an unknown start on a given map itself; otherwise it is made where the robot is found."""

    forgets: bool = False
    """It drops landmarks long out of view, so that it does not close loops."""

    minimises: bool | Callable[[Any], bool] = False
    """Its solution is the minimum of J, without a robust loss or rejection, always or with some options.

    Where a few steps from it lower J by much, its cell ends as `diverged`.
    """

    linear: bool = False
    """It linearises the models at a heading that is not its estimate.

    Where that heading is off, `bench check` only bounds it by dead reckoning.
    """

    implementation: str | Callable[[Any], str] = ""
    """The program that does the work, in two or three words for tables, or a function of the options that select it.

    Such as "compiled here" or "GTSAM's wheel": costs are those of an implementation as much as of an algorithm. If
    empty, the backend is listed under its distribution.
    """

    expects: bool = False
    """The backends of a `make` that is a function have the method of `Expects`; of a class this is known."""

    rules: Mapping[str, Callable[[Prior, Any, np.random.Generator], Backend]] = field(default_factory=dict, hash=False)
    """Further values of its option `association`, each with what makes the backend that carries it out by itself."""

    lacks: Callable[[], str] = str
    """Says which program that it needs is not installed here, and how to install it; "" if nothing is lacking.

    Its cells then end as `skipped`, with that reason.
    """

    online: bool | Callable[[Any], bool] = True
    """Each `step` returns a pose, always or with some options; False for a batch method, whose steps return None."""

    def implemented(self, options: Any) -> str:
        """The implementation with these options; "" if not declared."""
        return self.implementation if isinstance(self.implementation, str) else self.implementation(options)

    @property
    def leaves_out_loops(self) -> bool:
        """True if it runs without a log's loop closures: it could not close a loop by sightings either."""
        return not self.loops and (self.forgets or not self.sightings)

    def without(self, kind: Literal["partial", "fixes"]) -> bool:
        """True if it runs without such factors; one that uses no sightings does."""
        return not getattr(self, kind) and (kind in self.leaves_out or not self.sightings)

    @property
    def can_associate(self) -> bool:
        """True if data association is one of its options."""
        return callable(self.associates)

    def minimising(self, options: Any) -> bool:
        """True if its solution is the minimum of J with these options."""
        return self.minimises if isinstance(self.minimises, bool) else self.minimises(options)

    def is_online(self, options: Any) -> bool:
        """True if its steps return poses with these options."""
        return self.online if isinstance(self.online, bool) else self.online(options)

    def associating(self, options: Any) -> bool:
        """True if it does data association with these options."""
        return self.associates if isinstance(self.associates, bool) else self.associates(options)

    @property
    def summary(self) -> str:
        """The first line of the maker's docstring."""
        return (self.make.__doc__ or "").strip().partition("\n")[0]
