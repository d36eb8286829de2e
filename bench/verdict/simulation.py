"""Measures how often the verdict is right, on simulated comparisons with known answers.

python -m slamduel.bench.verdict.simulation [COMPARISONS]

Each figure is over that many comparisons (default 10,000), made by the functions that judge a run, and is printed with
the bounds it has to keep; the exit status is 1 if one does not. A log is harder or easier for all backends alike, and
each backend adds its own luck, so that the logarithms of the ratios of two backends' errors have standard deviation SD.
Of logs in clusters, a share of either variance is common to the logs of a cluster, their correlation r: "9 of 5, r =
0.4" are 9 clusters of 5 logs.
"""

import sys
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...core.se2 import Array
from .candidates import accelerated, mixed_model, percentile
from .cost_simulation import COSTS
from .statistics import compare, estimate, log_ratios
from .units import INDEPENDENT, Units, units

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
    correlation: float = 0.0  # of two logs of a cluster, in what all backends share and in a backend's luck
    tails: float = np.inf  # degrees of freedom of Student's t, of which a backend's luck is; infinite: normal

    def errors(self, logs: int, rng: np.random.Generator, clusters: Sequence[int] = ()) -> Errors:
        """Draws a run's errors; `clusters` are the sizes of the logs' clusters, where they are in such."""
        shape = len(self.ratios), logs
        luck = self._luck(shape, rng)
        luck[:, rng.random(logs) < self.same] = 0
        hard = rng.standard_normal(logs)
        if clusters:
            of = np.repeat(np.arange(len(clusters)), clusters)
            own, common = (1 - self.correlation) ** 0.5, self.correlation**0.5
            luck = own * luck + common * self._luck((len(self.ratios), len(clusters)), rng)[:, of]
            hard = own * hard + common * rng.standard_normal(len(clusters))[of]
        drawn = np.exp(HARDNESS * hard + SD / 2**0.5 * luck) * np.reshape(self.ratios, (-1, 1))
        drawn[rng.random(shape) < self.failing] = np.inf
        names = list(map(str, range(logs)))
        return {f"backend {k}": dict(zip(names, row, strict=True)) for k, row in enumerate(drawn.tolist())}

    def _luck(self, shape: tuple[int, int], rng: np.random.Generator) -> Array:
        return rng.standard_normal(shape) if np.isinf(self.tails) else rng.standard_t(self.tails, shape)

    @property
    def median(self) -> float:
        """The median of the first backend's errors, failures counted as infinite."""
        sd = (HARDNESS**2 + SD**2 / 2) ** 0.5
        return float(np.exp(NormalDist(sigma=sd).inv_cdf(0.5 / (1 - self.failing))))


Asked = Callable[[World, Errors, Units], bool]
Method = Callable[[Array, Sequence[Hashable]], tuple[float, float]]


def covers_ratio(world: World, errors: Errors, of: Units) -> bool:
    """True if the interval of the first two backends' ratio holds the true one."""
    found = compare(errors, of)[0]
    return found.low <= world.ratios[1] / world.ratios[0] <= found.high


def covers_median(world: World, errors: Errors, of: Units) -> bool:
    """True if the interval of the first backend's median holds the true one."""
    mine = errors["backend 0"]
    found = estimate(list(mine.values()), [of.unit(log) for log in mine])
    return found.low <= world.median <= found.high


def covers_by(method: Method) -> Asked:
    """The question if another method's interval of the first two backends' ratio holds the true one."""

    def covers(world: World, errors: Errors, of: Units) -> bool:
        one, other = (np.array(list(errors[f"backend {k}"].values())) for k in (0, 1))
        low, high = method(log_ratios(one, other), [of.unit(log) for log in errors["backend 0"]])
        return low <= np.log(world.ratios[1] / world.ratios[0]) <= high

    return covers


def claims(_: World, errors: Errors, of: Units) -> bool:
    """True if any difference is claimed."""
    return any(pair.holds for pair in compare(errors, of))


def claims_by_logs(world: World, errors: Errors, _: Units) -> bool:
    """True if any difference is claimed where logs of a cluster are taken as independent."""
    return claims(world, errors, INDEPENDENT)


def finds(_: World, errors: Errors, of: Units) -> bool:
    """True if the first backend is claimed to be closer than the second, which it is."""
    found = compare(errors, of)[0]
    return found.holds and found.ratio > 1


class Case(NamedTuple):
    """A simulated case."""

    logs: int
    world: World
    name: str = ""
    clusters: Sequence[int] = ()  # the sizes of the logs' clusters, where they are in such

    def share(self, asked: Asked, comparisons: int) -> float:
        """The share of so many comparisons for which it is true: the same each time."""
        rng = np.random.default_rng(0)
        of = units({str(log): str(k) for log, k in enumerate(np.repeat(range(len(self.clusters)), self.clusters))})
        found = (self.world.errors(self.logs, rng, self.clusters) for _ in range(comparisons))
        return sum(asked(self.world, errors, of) for errors in found) / comparisons


class Simulated(Protocol):
    """A case of errors, or of costs."""

    @property
    def logs(self) -> int:
        """The number of logs."""
        ...

    @property
    def name(self) -> str:
        """Returns its name in the table."""
        ...

    def share(self, asked: Any, comparisons: int) -> float:
        """The share of so many comparisons for which it is true."""
        ...


class Question(NamedTuple):
    """A question with the bounds of its share in every case; None: no bounds."""

    title: str
    asked: Callable[..., bool]
    bounds: tuple[float, float] | None
    cases: Sequence[Simulated]


_NUMBERS = (6, 8, 10, 15, 20, 30, 50)
_APART = World((1, BETTER))
_FAILING = World((1, BETTER), FAILING)
_FAILURES = "5 % failures"
_UNEVEN = (1, 2, 5, 8, 9)
_CORRELATIONS = (0.0, 0.4, 0.8)


def in_clusters(sizes: Sequence[int], world: World, name: str = "") -> Case:
    """Makes the case of clusters of these sizes."""
    each = f"{sizes[0]}" if len(set(sizes)) == 1 else f"{min(sizes)} to {max(sizes)}"
    said = f"{len(sizes)} of {each}, r = {world.correlation:g}" + f", {name}" * bool(name)
    return Case(sum(sizes), world, said, tuple(sizes))


def _related(world: World) -> list[World]:
    return [replace(world, correlation=one) for one in _CORRELATIONS]


def _alike(count: int, world: World) -> tuple[Case, ...]:
    """Makes the cases of so many clusters of five logs."""
    return tuple(in_clusters((5,) * count, one) for one in _related(world))


CLUSTERED = (
    Question("95 % interval of a ratio, clusters", covers_ratio, COVERAGE, (
        *(in_clusters((5,) * k, world) for k in (5, 6, 9) for world in _related(_APART)),
        *(in_clusters((5,) * k, replace(_APART, correlation=0.4)) for k in (3, 20)),
        *(in_clusters(sizes, replace(_APART, correlation=0.4)) for sizes in (_UNEVEN, 2 * _UNEVEN)),
        in_clusters((5,) * 5, replace(_APART, correlation=0.4, tails=3), "heavy tails"),
        in_clusters((5,) * 9, replace(_FAILING, correlation=0.4), _FAILURES),
    )),
    Question("95 % interval of a median, clusters", covers_median, COVERAGE, (
        *(in_clusters((5,) * k, world) for k in (6, 9) for world in _related(_APART)),
        in_clusters((5,) * 20, replace(_APART, correlation=0.4)),
    )),
    Question("difference claimed, clusters", claims, FALSE_CLAIMS, (
        *(in_clusters((5,) * k, world) for k in (5, 6, 9) for world in _related(World())),
        in_clusters(2 * _UNEVEN, World(correlation=0.4)),
        in_clusters((5,) * 20, World((1,) * 4, correlation=0.4), "4 backends"),
        in_clusters((5,) * 9, World(failing=FAILING, correlation=0.4), _FAILURES),
    )),
    Question("if logs counted, no bound set", claims_by_logs, None, _alike(5, World())),
    Question("by percentiles, no bound set", covers_by(percentile), None, _alike(5, _APART)),
    Question("by BCa, no bound set", covers_by(accelerated), None, _alike(5, _APART)),
    Question("by a mixed model, no bound set", covers_by(mixed_model), None, _alike(5, _APART)),
    Question("20 % found in clusters, no bound set", finds, None, _alike(9, _APART)),
)  # fmt: skip

QUESTIONS = (
    Question("95 % interval of a ratio covers it", covers_ratio, COVERAGE, (
        *(Case(logs, _APART) for logs in _NUMBERS),
        Case(30, World((1, BETTER), tails=2), "heavy tails"),
        *(Case(logs, _FAILING, _FAILURES) for logs in (8, 30)),
    )),
    Question("95 % interval of a median covers it", covers_median, COVERAGE, (
        *(Case(logs, _APART) for logs in _NUMBERS),
        *(Case(logs, _FAILING, _FAILURES) for logs in (8, 30)),
    )),
    Question("difference claimed where none is", claims, FALSE_CLAIMS, (
        *(Case(logs, World(), "2 backends") for logs in (6, 10, 30)),
        *(Case(30, World((1,) * k), f"{k} backends") for k in (3, 4)),
        *(Case(30, World((1,) * k, FAILING), f"{k} backends, {_FAILURES}") for k in (2, 4)),
        Case(30, World(same=1 / 3), "2 backends, 1/3 of logs alike"),
    )),
    Question("20 % difference found", finds, POWER, (Case(30, _APART, "2 backends"),)),
    Question("the same, with no bound set", finds, None, (
        Case(30, World((1, BETTER, BETTER)), "3 backends"),
        Case(30, _FAILING, f"2 backends, {_FAILURES}"),
        *(Case(logs, _APART, "2 backends") for logs in (10, 20)),
    )),
    *CLUSTERED,
    *(Question(*one) for one in COSTS),
)  # fmt: skip


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
