"""Runs a backend under examination over a log, and keeps all its answers."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...backends.api import Backend, Belief, Builder, Map, Pose, Solution, TakesOut
from ...core import se2
from ...core.factors import Log, Prior
from ...core.se2 import Array
from .small_logs import dead_reckoned

SIGMAS = 6.0  # standard deviations that an estimate may be off: a sound backend exceeds it once in a billion steps
ROUNDING = 1e-6  # m and rad that rounding and early-stopped iterations may add up to in some tens of metres


class Failed(Exception):
    """A backend does not meet a check; the text says what was found and what was expected."""


class NotApplicable(Exception):
    """A check does not concern this backend; the text says why."""


class GaveUp(Exception):
    """A backend raised Diverged where it may; the text is its reason."""


class Trial(NamedTuple):
    """All answers of a backend over one log of n steps."""

    returned: list[Pose | None]  # as returned by step
    poses: list[Pose | None]  # copies of the same, made at once
    beliefs: list[Belief | None]  # after every step if asked for, else empty
    map: Map  # after the last step
    solution: Solution | None
    takes_out: bool = False  # it takes landmarks that move out of the log

    @property
    def paths(self) -> dict[str, Array]:
        """The paths (n, 3) it gave: online, final or both."""
        paths: dict[str, Array] = {}
        online = [pose for pose in self.poses if pose is not None]
        if online:
            if len(online) < len(self.poses):
                raise Failed(f"step returned {len(online)} poses and None otherwise in {len(self.poses)} steps")
            paths["online"] = np.array(online)
        if self.solution is not None:
            paths["final"] = self.solution.path
        if not paths:
            raise Failed("neither step nor finish returned a pose")
        for which, path in paths.items():
            if path.shape != (len(self.poses), 3):
                raise Failed(f"the {which} path has shape {path.shape}, expected ({len(self.poses)}, 3)")
            odd = np.any(~np.isfinite(path), axis=1)
            if odd.any():
                raise Failed(f"the {which} path is not finite from step {first(odd)} on")
        return paths

    @property
    def final_map(self) -> Map:
        """The last map: the solution's where there is one."""
        return self.map if self.solution is None else self.solution.map


@dataclass(frozen=True)
class Candidate:
    """A backend under examination: a builder and its options."""

    builder: Builder
    options: Any

    @property
    def associates(self) -> bool:
        """True if it does data association."""
        return self.builder.associating(self.options)

    def fresh(self, prior: Prior, seed: int = 0) -> Backend:
        """Makes a new backend with its own generator."""
        return self.builder.make(prior, self.options, np.random.default_rng(seed))

    def run(self, log: Log, *, seed: int = 0, asking: bool = False) -> Trial:
        """Runs `log` through a new backend; `asking` for its belief and map after every step."""
        backend = self.fresh(log.prior, seed)
        returned: list[Pose | None] = []
        poses: list[Pose | None] = []
        beliefs: list[Belief | None] = []
        for step in log:
            pose = backend.step(step)
            returned.append(pose)
            poses.append(None if pose is None else np.array(pose))
            if asking:
                beliefs.append(backend.belief())
                backend.map()
        landmarks, solution = backend.map(), backend.finish()
        takes_out = isinstance(backend, TakesOut) and backend.taken_out() is not None
        return Trial(returned, poses, beliefs, landmarks, solution, takes_out)

    def with_landmarks(self, log: Log) -> Trial:
        """Runs `log` for a check of landmarks: NotApplicable where the map stays empty."""
        trial = self.run(log)
        if len(trial.final_map.ids) == 0:
            raise NotApplicable("it builds no map")
        return trial

    def slack(self, log: Log) -> tuple[Array, Array]:
        """Bounds the error, (n,) m and (n,) rad, of an estimate on an *exact* log.

        Odometry's first-order spread bounds the errors of sampling, so a random backend may be off by SIGMAS of it. Any
        backend may be off by the second order, path length times heading variance, in which sound filters differ.
        """
        _, cov = dead_reckoned(log)
        length = np.concatenate(([1.0], 1.0 + np.cumsum(np.hypot(log.delta[1:, 0], log.delta[1:, 1]))))
        second_order = ROUNDING + length * cov[:, 2, 2]
        if not self.builder.random:
            return second_order, second_order
        position, heading = spread(cov)
        return second_order + position, second_order + heading


def spread(cov: Array) -> tuple[Array, Array]:
    """Returns SIGMAS standard deviations of pose covariances (n, 3, 3): of position at its widest, and of heading."""
    worst = np.linalg.eigvalsh(cov[:, :2, :2])[:, -1]
    return SIGMAS * np.sqrt(worst), SIGMAS * np.sqrt(cov[:, 2, 2])


def first(wrong: NDArray[np.bool]) -> int:
    """The first step at which `wrong` (n,) is true."""
    return int(np.argmax(wrong))


def stays_near(path: Array, expected: Array, allowed: tuple[Array, Array], what: str) -> float:
    """The largest distance (m) of `path` (n, 3) from `expected`; Failed beyond `allowed`, (n,) m and rad."""
    distance = np.linalg.norm((path - expected)[:, :2], axis=1)
    turn = np.abs(se2.wrap(path[:, 2] - expected[:, 2]))
    for error, bound, unit in ((distance, allowed[0], "m"), (turn, allowed[1], "rad")):
        if (error > bound).any():
            k = first(error > bound)
            raise Failed(f"{what} is {error[k]:.3g} {unit} off at step {k}, expected at most {bound[k]:.3g} {unit}")
    return float(distance.max())


def same(path: dict[str, Array], other: dict[str, Array], what: str) -> None:
    """Raises Failed unless two runs gave the same paths bit for bit; `what` names the runs."""
    if path.keys() != other.keys():
        raise Failed(f"{what}: one gave {' and '.join(path)} poses, the other {' and '.join(other)}")
    for which, poses in path.items():
        differs = np.any(poses != other[which], axis=1)
        if differs.any():
            gap = np.abs(poses - other[which]).max()
            raise Failed(f"{what}: the {which} paths differ from step {first(differs)} on, by up to {gap:.3g}")
