"""Backends that break every rule, by name: `misbehaving:raises` and so on."""

import ctypes
import os
import re
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slamduel.backends.api import (
    Belief,
    Builder,
    Diverged,
    Map,
    NoOptions,
    Pose,
    Prior,
    Solution,
    Step,
    compose,
    option,
)

TROUBLE_AT = 5
"""The step at which it happens."""


class Reckoning:
    """Dead reckoning, until step `AT`."""

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        self.pose, self.steps, self.options, self.rng = prior.pose, 0, options, rng

    def step(self, step: Step) -> Any:
        if step.odometry is not None:
            self.pose = compose(self.pose, step.odometry.delta)
        self.steps += 1
        if self.steps == TROUBLE_AT:
            self.trouble()
        return self.answer()

    def trouble(self) -> None:
        """Misbehave."""

    def answer(self) -> Any:
        return self.pose

    def belief(self) -> Any:
        return Belief(self.pose)

    def map(self) -> Any:
        return Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> Solution | None:
        return None


class DiffersByProcess(Reckoning):
    """Has a path that is the same in one process, and another one in the next."""

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        super().__init__(prior, options, rng)
        self.pose = prior.pose + 1e-9 * os.getpid()


class FailsWhereAsked(Reckoning):
    """Raises once the folder that FAIL_IN names is there."""

    def trouble(self) -> None:
        if os.path.isdir(os.environ.get("FAIL_IN", "")):
            raise ValueError("asked for")


class Busy(Reckoning):
    """Takes half a second of CPU time in a step."""

    def trouble(self) -> None:
        end = time.process_time() + 0.5
        while time.process_time() < end:
            pass


class Raises(Reckoning):
    def trouble(self) -> None:
        raise ValueError("the [brackets] of this\nmessage are <b>not</b> markup")


class Shouts(Reckoning):
    def trouble(self) -> None:
        raise RuntimeError("bad \ud800 \x1b[31m \x00 :x: [bold]$_%&|<b>\nand more" + " and more" * 500_000)


class NotANumber(Reckoning):
    def answer(self) -> Pose:
        return self.pose if self.steps < TROUBLE_AT else np.array([np.nan, 0.0, 0.0])


class LeavesTheEarth(Reckoning):
    def answer(self) -> Pose:
        return self.pose if self.steps < TROUBLE_AT else self.pose + np.array([3e12, 0.0, 0.0])


class GivesUp(Reckoning):
    def trouble(self) -> None:
        raise Diverged("the covariance is no longer positive definite")


class LoopsForEver(Reckoning):
    def trouble(self) -> None:
        while True:
            pass


class SleepsForEver(Reckoning):
    def trouble(self) -> None:
        time.sleep(10_000)


class EatsMemory(Reckoning):
    def trouble(self) -> None:
        hoard = [np.ones(10_000_000)]
        while True:
            hoard.append(np.ones(10_000_000))


class KillsItself(Reckoning):
    def trouble(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class KillsItsRunner(Reckoning):
    """Kills the process that started its process's fork server."""

    def trouble(self) -> None:
        server = Path(f"/proc/{os.getppid()}/stat").read_text().rpartition(")")[2].split()
        os.kill(int(server[1]), signal.SIGKILL)
        time.sleep(10_000)


class Crashes(Reckoning):
    def trouble(self) -> None:
        print("reading address zero now", file=sys.stderr, flush=True)
        ctypes.string_at(0)


class Exits(Reckoning):
    def trouble(self) -> None:
        sys.exit("had enough")


class WrongShape(Reckoning):
    def answer(self) -> Any:
        return np.zeros(2)


class ComplexPose(Reckoning):
    def answer(self) -> Any:
        return self.pose + 1j


class SometimesNone(Reckoning):
    def answer(self) -> Any:
        return self.pose if self.steps % 2 else None


class WrongBelief(Reckoning):
    def belief(self) -> Any:
        return self.pose, np.eye(3)


class BelievesElsewhere(Reckoning):
    def belief(self) -> Belief:
        return Belief(self.pose + 5.0 * (self.steps >= TROUBLE_AT), np.eye(3))


class TwiceInMap(Reckoning):
    def map(self) -> Any:
        return Map(np.array([4, 7, 7]), np.zeros((3, 2)), None)


class HalfLandmarks(Reckoning):
    def map(self) -> Any:
        return Map(np.array([1.5, 2.0]), np.zeros((2, 2)), None)  # type: ignore[arg-type]


class BeliefChangesPath(Reckoning):
    def belief(self) -> Belief:
        self.pose = self.pose + 1e-15
        return Belief(self.pose)


class Talks(Reckoning):
    """Well behaved, but it prints."""

    def trouble(self) -> None:
        print("a great deal of output\n" * 10_000)


class Draws(Reckoning):
    """Well behaved and random."""

    def answer(self) -> Pose:
        self.pose = self.pose + 0.01 * self.rng.normal(size=3)
        return self.pose


@dataclass(frozen=True)
class Pace:
    """The delay."""

    seconds: float = option(0.0, "seconds that step 5 takes", minimum=0)


class Slow(Reckoning):
    """Well behaved, but slow."""

    def trouble(self) -> None:
        time.sleep(self.options.seconds)


def _named(kind: type) -> str:
    """NotANumber is not_a_number."""
    return re.sub("(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


globals().update({_named(kind): Builder(kind) for kind in Reckoning.__subclasses__()})
draws = Builder(Draws, options=NoOptions, random=True)
slow = Builder(Slow, options=Pace)
raises_on_loops = Builder(Raises, loops=True)
no_builder = 7
no_options = Builder(Reckoning, options=dict)
