"""Simulates costs measured in rounds on a machine whose speed drifts and steps, for the study of intervals.

Cells run one after another, in every round each log with all its backends in turn, shuffled. The logarithm of a cell's
time adds up what the log costs its backend, what the process of that round adds, the machine's state at that moment,
and noise of the cell alone. The state is a random walk with steps: common to all backends of a round but for what
changes from one cell to the next.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from ..measure.repeats import two_way
from .costs import MARGIN

BACKENDS = 4  # in a round; the first two are compared
RATIO = 1.3  # of the second one's cost to the first one's


@dataclass(frozen=True)
class Machine:
    """Standard deviations of logarithms of times."""

    logs: float = 0.15  # over logs, of what a log costs a backend more than another one
    processes: float = 0.05  # over rounds, of what a process adds
    noise: float = 0.15  # over cells
    drift: float = 0.0  # from a cell to the next
    steps: float = 0.0  # of a step of the machine's state
    often: float = 0.01  # steps per cell
    tails: float = np.inf  # degrees of freedom of Student's t, of which the noise is; infinite: normal
    ratio: float = RATIO

    def times(self, logs: int, rounds: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draws logarithms of times (BACKENDS, logs, rounds) and the machine's state at each."""
        shape = BACKENDS, logs, rounds
        at = rng.random((rounds, logs, BACKENDS)).argsort(axis=2)  # when each backend runs
        cells = rounds * logs * BACKENDS
        state = self.drift * rng.standard_normal(cells)
        state += self.steps * rng.standard_normal(cells) * (rng.random(cells) < self.often)
        state = state.cumsum().reshape(rounds, logs, BACKENDS)
        here = np.take_along_axis(state, at, axis=2).transpose(2, 1, 0)
        normal = np.isinf(self.tails)
        noise = rng.standard_normal(shape) if normal else rng.standard_t(self.tails, shape)
        own = self.logs / 2**0.5 * rng.standard_normal((BACKENDS, logs, 1))
        process = self.processes / 2**0.5 * rng.standard_normal((BACKENDS, 1, rounds))
        base = np.zeros(shape)
        base[1] = np.log(self.ratio)
        return base + own + process + self.noise * noise + here, here


def covers_ratio(machine: Machine, times: Array, state: Array) -> bool:
    """True if the interval of the first two backends' ratio holds the true one."""
    del state
    found = two_way(times[1] - times[0])
    return found.low <= np.log(machine.ratio) <= found.high


def covers_cost(machine: Machine, times: Array, state: Array) -> bool:
    """True if the interval of the first one's cost holds its cost in the machine's mean state of the run."""
    del machine
    found = two_way(times[0])
    return found.low <= state.mean() <= found.high


def claims(machine: Machine, times: Array, state: Array) -> bool:
    """True if one of the first two is said to be cheaper."""
    del machine, state
    found = two_way(times[1] - times[0])
    return max(found.low, -found.high) > np.log(MARGIN)


Asked = Callable[[Machine, Array, Array], bool]


class Case(NamedTuple):
    """A simulated case."""

    logs: int
    rounds: int
    machine: Machine
    said: str

    @property
    def name(self) -> str:
        """Returns its name in the table."""
        return f"{self.rounds} rounds, {self.said}"

    def share(self, asked: Asked, comparisons: int) -> float:
        """The share of so many comparisons for which it is true: the same each time."""
        rng = np.random.default_rng(0)
        drawn = (self.machine.times(self.logs, self.rounds, rng) for _ in range(comparisons))
        return sum(asked(self.machine, *one) for one in drawn) / comparisons


STEADY, DRIFTS = Machine(), Machine(drift=0.02, steps=0.4)
ALIKE = replace(DRIFTS, ratio=1.0)


def _sizes(machine: Machine, said: str, sizes: Sequence[tuple[int, int]]) -> list[Case]:
    """Makes cases of logs and rounds; what is said of a single log is said of it alone."""
    return [Case(n, rounds, machine if n > 1 else replace(machine, logs=0), said) for n, rounds in sizes]


COSTS = (
    ("95 % interval of a ratio of costs", covers_ratio, (0.93, 0.97), (
        *_sizes(STEADY, "steady", ((1, 3), (1, 10), (10, 3), (10, 5), (10, 10), (30, 5))),
        *_sizes(DRIFTS, "drifts and steps", ((1, 3), (1, 5), (1, 10), (10, 3), (10, 5), (10, 10), (30, 5))),
    )),
    ("the same, at least 93 %", covers_ratio, (0.93, 1.0), (
        *_sizes(DRIFTS, "drifts and steps", ((2, 5), (3, 3), (5, 5))),
        *_sizes(replace(DRIFTS, tails=3), "heavy tails", ((1, 5), (5, 5), (10, 5))),
        *_sizes(replace(STEADY, logs=0, processes=0), "noise of cells", ((5, 5), (10, 5))),
        *_sizes(replace(STEADY, logs=0, processes=0.1), "of processes", ((5, 5), (10, 5))),
    )),
    ("95 % interval of a cost", covers_cost, (0.93, 1.0), (
        *_sizes(STEADY, "steady", ((1, 5), (10, 5))),
        *_sizes(DRIFTS, "drifts and steps", ((1, 5), (10, 5))),
    )),
    ("called cheaper, equal or by load", claims, (0.0, 0.055), (
        *_sizes(ALIKE, "equal", ((1, 5), (10, 5))),
        *_sizes(replace(DRIFTS, ratio=MARGIN), "shifted", ((1, 5), (10, 5))),
    )),
    ("twice, thrice found, no bound set", claims, None, (
        *_sizes(replace(DRIFTS, ratio=2.0), "twice", ((1, 3), (1, 5), (10, 3), (10, 5))),
        *_sizes(replace(DRIFTS, ratio=3.0), "thrice", ((1, 3), (1, 5), (10, 3), (10, 5))),
    )),
)  # fmt: skip
"""Questions of the study: title, what is asked, its bounds, and the cases."""
