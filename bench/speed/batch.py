"""`bench speed --batch`: the batch optimum by our solver and by GTSAM's Levenberg-Marquardt, from the same start.

GTSAM's is timed with both of its multifrontal solvers. Timed are ordering, linearising, eliminating and stepping until
J stops falling, but not writing down the factors, reading the log or covariances. Where two solvers end at different
minima, as from bad dead reckoning, there is no ratio.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from ...backends.api import Diverged
from ...core.factors import Log, Map
from ...core.files import write_whole
from ...core.se2 import Array
from ...datasets import registry as datasets
from ...datasets.cache import generator
from ..words.console import plain

OPTIONS = ("rounds",)  # the study's own options
ROUNDS, QUICK = 5, 1  # rounds in which each solver is timed, in turns; the fastest counts
LONG = 5.0  # s of CPU; after a round that takes longer there is no other

LOGS = {
    "bailey": {},
    "circle": {},
    "victoria-park": {},
    "city[landmarks=100,steps=3000]": {"landmarks": 100, "steps": 3000},
    "city[landmarks=1000,steps=5000]": {"landmarks": 1000, "steps": 5000},
}
STARTS = ("incremental", "odometry")
SOLVERS = ("MULTIFRONTAL_CHOLESKY", "MULTIFRONTAL_SOLVER")

TOLERANCE, ITERATIONS = 1e-12, 1000  # of both solvers
THE_SAME = 1e-3  # share by which J may differ at one minimum, as the two residuals of a motion differ


class Run(NamedTuple):
    """One run of a solver."""

    ms: float  # of CPU; infinite where it gave up
    cost: float  # its J


class SolverRow(NamedTuple):
    """A log from a start."""

    log: str
    start: str
    own: Run
    gtsam: Run  # the faster of the two

    @property
    def ratio(self) -> float | None:
        """Returns how many times faster ours is; None where they end at different minima."""
        most = max(self.own.cost, self.gtsam.cost)
        same = most < np.inf and abs(self.own.cost - self.gtsam.cost) <= THE_SAME * most
        return self.gtsam.ms / self.own.ms if same else None


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Adds the study's own options."""
    group.add_argument("--rounds", type=int, metavar="N", help=f"the fastest of which counts ({ROUNDS}; quick {QUICK})")


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    rounds = max(1, namespace.rounds or (QUICK if namespace.quick else ROUNDS))
    names = list(LOGS)[:1] if namespace.quick else list(LOGS)
    rows = list[SolverRow]()
    for name in names:
        source = datasets.find(name.partition("[")[0])
        log = source.make(source.options(**LOGS[name]), generator(name.partition("[")[0], namespace.seed)).log
        rows += [measured(name, log.identified(), start, rounds) for start in STARTS]
        console.print(f"[dim]timed {plain(name)}[/]", highlight=False)
    console.print(_table(rows))
    files = [namespace.csv] * (namespace.csv is not None)
    files += [] if namespace.out is None else [namespace.out / "batch.csv"]
    lines = [f'"{r.log}",{r.start},{r.own.ms},{r.own.cost},{r.gtsam.ms},{r.gtsam.cost}\n' for r in rows]
    for path in files:
        write_whole(path, "log,start,own_ms,own_j,gtsam_ms,gtsam_j\n" + "".join(lines))
    return files


def measured(name: str, log: Log, start: str, rounds: int) -> SolverRow:
    """Times both solvers in turns; the fastest run of each counts. Our first, which loads code, is not counted."""
    path, landmarks = started(log, start)
    own, gtsam = [_own(log, path, landmarks)], list[Run]()
    for _ in range(rounds):
        begun = time.process_time()
        own.append(_own(log, path, landmarks))
        gtsam += [_gtsam(log, path, landmarks, solver) for solver in SOLVERS]
        if time.process_time() - begun > LONG:
            break
    return SolverRow(name, start, min(own[1:]), min(gtsam))


def started(log: Log, start: str) -> tuple[Array, Map]:
    """Returns where the batch `graph` begins with that option `start`: path (n, 3) and landmarks."""
    from ...backends.graphs.batch import Batch

    batch = Batch(log, 0, 0.0)
    if start == "odometry":
        batch.start_by_odometry()
    else:
        batch.start_by_chunks()
    return batch.place()


def geometric_mean(rows: Sequence[SolverRow]) -> float:
    """The geometric mean of the known ratios."""
    return float(np.exp(np.mean([np.log(row.ratio) for row in rows if row.ratio])))


def _own(log: Log, path: Array, landmarks: Map) -> Run:
    from ...backends.graphs.batch import Batch

    batch = Batch(log, 0, 0.0)
    batch.write_at(path, landmarks)
    begun = time.process_time()
    try:
        batch.order()
        fit = batch.fit(TOLERANCE, ITERATIONS)
    except Diverged:
        return Run(np.inf, np.inf)
    return Run(1e3 * (time.process_time() - begun), fit.cost)


def _gtsam(log: Log, path: Array, landmarks: Map, solver: str) -> Run:
    import gtsam

    from ...backends.graphs._gtsam import FAILURES, Factors, pose2

    factors = Factors(log.prior, at_once=True)
    graph, values = factors.prior()
    for k, step in enumerate(log):
        more, more_values = factors.step(k, step, pose2(path[k]))
        graph.push_back(more)
        values.insert(more_values)
    for landmark, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
        values.update(factors.keys.landmark(landmark), xy)
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(TOLERANCE)
    params.setAbsoluteErrorTol(0.0)
    params.setMaxIterations(ITERATIONS)
    params.setLinearSolverType(solver)
    begun = time.process_time()
    try:
        best = gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
    except FAILURES:
        return Run(np.inf, np.inf)
    return Run(1e3 * (time.process_time() - begun), 2 * graph.error(best))


def _table(rows: Sequence[SolverRow]) -> Table:
    table = Table(title=plain(f"CPU time of the batch optimum, ms; geometric mean {geometric_mean(rows):.1f} times"))
    table.add_column("log")
    table.add_column("start")
    for heading in ("own", "GTSAM", "GTSAM / own", "J, own", "J, GTSAM"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:.1f}"
        figures = (f"{row.own.ms:.1f}", f"{row.gtsam.ms:.1f}", ratio, f"{row.own.cost:.6g}", f"{row.gtsam.cost:.6g}")
        table.add_row(plain(row.log), row.start, *figures)
    return table
