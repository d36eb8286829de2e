"""Measures how often the verdict is right, on simulated comparisons with known answers.

python -m slamduel.bench.verdict.simulation [COMPARISONS]

Each figure is over that many comparisons (default 10,000), made by the functions that judge a run, and is printed with
the bounds it has to keep; the exit status is 1 if one does not. A log is harder or easier for all backends alike, and
each backend adds its own luck, so that the logarithms of the ratios of two backends' errors have standard deviation SD.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from .statistics import compare, estimate

COMPARISONS = 10_000

SD = 0.3  # of the logarithm of the ratio of two backends' errors, over logs
HARDNESS = 1.0  # standard deviation, over logs, of the logarithm of what all backends' errors have in common
FAILING = 0.05  # share of its logs on which a backend fails where failures are planted
BETTER = 1.2  # the planted ratio: the second backend's errors are 20 % larger than the first's

COVERAGE = (0.93, 0.97)
FALSE_CLAIMS = (0.0, 0.055)
POWER = (0.8, 1.0)

Errors = Mapping[str, Mapping[str, float]]  # by backend and by log


@dataclass(frozen=True)
class World:
    """A distribution of simulated errors."""

    ratios: Sequence[float] = (1.0, 1.0)  # of the errors, by backend
    failing: float = 0.0  # the share of logs on which a backend fails
    same: float = 0.0  # the share of logs on which all backends have the very same error
    tails: float = np.inf  # degrees of freedom of Student's t, of which a backend's luck is; infinite: normal

    def errors(self, logs: int, rng: np.random.Generator) -> Errors:
        """Draws a run's errors."""
        shape = len(self.ratios), logs
        luck = rng.standard_normal(shape) if np.isinf(self.tails) else rng.standard_t(self.tails, shape)
        luck[:, rng.random(logs) < self.same] = 0
        drawn = np.exp(HARDNESS * rng.standard_normal(logs) + SD / 2**0.5 * luck) * np.reshape(self.ratios, (-1, 1))
        drawn[rng.random(shape) < self.failing] = np.inf
        names = list(map(str, range(logs)))
        return {f"backend {k}": dict(zip(names, row, strict=True)) for k, row in enumerate(drawn.tolist())}

    @property
    def median(self) -> float:
        """Returns the median of the first backend's errors, failures counted as infinite."""
        sd = (HARDNESS**2 + SD**2 / 2) ** 0.5
        return float(np.exp(NormalDist(sigma=sd).inv_cdf(0.5 / (1 - self.failing))))


def covers_ratio(world: World, errors: Errors) -> bool:
    """Returns True if the interval of the first two backends' ratio holds the true one."""
    found = compare(errors)[0]
    return found.low <= world.ratios[1] / world.ratios[0] <= found.high


def covers_median(world: World, errors: Errors) -> bool:
    """Returns True if the interval of the first backend's median holds the true one."""
    found = estimate(list(errors["backend 0"].values()))
    return found.low <= world.median <= found.high


def claims(_: World, errors: Errors) -> bool:
    """Returns True if any difference is claimed."""
    return any(pair.holds for pair in compare(errors))


def finds(_: World, errors: Errors) -> bool:
    """Returns True if the first backend is claimed to be closer than the second, which it is."""
    found = compare(errors)[0]
    return found.holds and found.ratio > 1


class Case(NamedTuple):
    """A simulated case."""

    logs: int
    world: World
    name: str = ""

    def share(self, asked: Callable[[World, Errors], bool], comparisons: int) -> float:
        """Returns the share of so many comparisons for which it is true: the same each time."""
        rng = np.random.default_rng(0)
        return sum(asked(self.world, self.world.errors(self.logs, rng)) for _ in range(comparisons)) / comparisons


class Question(NamedTuple):
    """A question with the bounds of its share in every case; None: no bounds."""

    title: str
    asked: Callable[[World, Errors], bool]
    bounds: tuple[float, float] | None
    cases: Sequence[Case]


_NUMBERS = (6, 8, 10, 15, 20, 30, 50)
_APART = World((1, BETTER))
_FAILING = World((1, BETTER), FAILING)
_FAILURES = "5 % failures"

QUESTIONS = (
    Question(
        "95 % interval of a ratio covers it",
        covers_ratio,
        COVERAGE,
        (
            *(Case(logs, _APART) for logs in _NUMBERS),
            Case(30, World((1, BETTER), tails=2), "heavy tails"),
            *(Case(logs, _FAILING, _FAILURES) for logs in (8, 30)),
        ),
    ),
    Question(
        "95 % interval of a median covers it",
        covers_median,
        COVERAGE,
        (*(Case(logs, _APART) for logs in _NUMBERS), *(Case(logs, _FAILING, _FAILURES) for logs in (8, 30))),
    ),
    Question(
        "difference claimed where none is",
        claims,
        FALSE_CLAIMS,
        (
            *(Case(logs, World(), "2 backends") for logs in (6, 10, 30)),
            *(Case(30, World((1,) * k), f"{k} backends") for k in (3, 4)),
            *(Case(30, World((1,) * k, FAILING), f"{k} backends, {_FAILURES}") for k in (2, 4)),
            Case(30, World(same=1 / 3), "2 backends, 1/3 of logs alike"),
        ),
    ),
    Question("20 % difference found", finds, POWER, (Case(30, _APART, "2 backends"),)),
    Question(
        "the same, with no bound set",
        finds,
        None,
        (
            Case(30, World((1, BETTER, BETTER)), "3 backends"),
            Case(30, _FAILING, f"2 backends, {_FAILURES}"),
            *(Case(logs, _APART, "2 backends") for logs in (10, 20)),
        ),
    ),
)


def main(comparisons: int = COMPARISONS) -> int:
    """Prints the study as a table; 1 where a share is out of its bounds."""
    from rich import box
    from rich.console import Console
    from rich.progress import track
    from rich.table import Table

    table = Table("", "logs", "expected", "measured", title=f"{comparisons:,} comparisons per row", box=box.SIMPLE)
    table.columns[0].no_wrap = True
    for column in table.columns[1:]:
        column.justify = "right"
    missed = 0
    for question in track(QUESTIONS, "Simulating", transient=True):
        low, high = question.bounds or (0, 1)
        table.add_section()
        table.add_row(question.title)
        for case in question.cases:
            share = case.share(question.asked, comparisons)
            expected = f"{100 * low:g} to {100 * high:g} %" if question.bounds else ""
            out = not low <= share <= high
            table.add_row(f"  {case.name}", str(case.logs), expected, f"{'missed: ' * out}{100 * share:.2f} %")
            missed += out
    Console().print(table)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2])))
