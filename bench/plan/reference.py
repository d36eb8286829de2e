"""Computes the batch optimum of a log without ground truth, a reference for online estimates.

It is a maximum-likelihood estimate from the same factors that every backend gets, so smoothers come close to it by
construction, and no verdict on accuracy is drawn from it. Where outliers such as wrong ids or false loop closures would
rule it, the optimum is that of a Cauchy loss, and says so.
"""

import contextlib
import hashlib
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ... import backends
from ...backends.api import Diverged, Solution
from ...core.errors import InputError
from ...core.factors import UNKNOWN, Dataset, Log, Map, Start, Truth
from ...core.files import cache_folder
from ...core.se2 import Array, act
from ...core.truth.errors import named
from ...datasets import archive
from ...datasets import registry as datasets
from ...datasets.on_demand.ready import made_ready
from ...datasets.remarks import remarked
from ..measure.accuracy import align
from ..measure.misfit import loop_misfits, misfits, partial_misfits
from .given_map import localising

PART_MEDIAN, MEDIAN, LOOP_MEDIAN = 0.455, 1.386, 2.366  # median of chi-square with 1 degree of freedom, 2, and 3
PART_FAR, FAR, LOOP_FAR = 15.14, 18.42, 21.11  # chi-square with 1, 2 and 3 exceeds it once in 10,000
MANY = 5e-3  # share of sightings or loops beyond FAR that rules the optimum: fifty times that of correct noise
NO_REFERENCE = "no true path is known and no batch optimum was found: nothing is measured from either"
FEWEST = 3  # landmarks needed to align two maps


class Outliers(NamedTuple):
    """The number of sightings, or of loop closures, that do not fit an optimum."""

    found: int
    of: int

    @property
    def many(self) -> bool:
        """True if there are more of them than chance explains."""
        return self.found > max(2, MANY * self.of)


def reference(log: Log) -> Truth | None:
    """Finds the optimum of J by `graph`; None where there is none. Kept in the user's cache by the log's digest."""
    entry = cache_folder() / f"reference-{_key(log)}.npz"
    with contextlib.suppress(InputError):
        return archive.load(entry).truth
    truth = _found(log)
    if truth is not None:
        with contextlib.suppress(OSError):
            entry.parent.mkdir(parents=True, exist_ok=True)
            archive.save(entry, Dataset(log, truth))
    return truth


def made_with_reference(
    name: str, options: Any, seed: int, given: Map | None = None, start: Start = "known"
) -> Dataset:
    """Makes the log of a dataset, with a reference where its ground truth is not known; InputError where it cannot be.

    `given` and `start` go into its prior.
    """
    made = made_ready(name, datasets.find(name), options, seed)
    log = made.log if given is None else localising(made.log, given, f"dataset {name}", start)
    truth = known(log, made.truth)
    if truth is None or (not len(truth.t) and truth.relations is None):
        log = remarked(log, [NO_REFERENCE])
    return Dataset(log, truth)


def known(log: Log, truth: Truth | None) -> Truth | None:
    """Returns `truth` if it has a path or relations, else a reference, aligned with true landmarks if there are any.

    The reference is that of the true ids, so that hidden ones do not change it.
    """
    if truth is not None and (len(truth.t) or truth.relations is not None):
        return truth
    path = reference(named(log, truth))
    if path is None or truth is None:
        return path or truth
    kept = {name: getattr(truth, name) for name in ("assigned", "assigned_partial", "false_loops")}
    if truth.map is None or path.map is None:
        return path._replace(**kept)
    return path._replace(map=_beside(truth.map, path.map), places="truth", moving=truth.moving, **kept)


def outliers(log: Log, solution: Solution) -> Outliers:
    """Counts the sightings that do not fit an optimum, relative to the typical misfit: noise may be misstated."""
    squared = misfits(log, solution.path, solution.map)
    parts = partial_misfits(log, solution.path, solution.map, solution.constant)
    if squared is None or parts is None:
        return Outliers(0, int((log.ids != UNKNOWN).sum()))
    whole, alone = _beyond(squared, MEDIAN, FAR), _beyond(parts, PART_MEDIAN, PART_FAR)
    return Outliers(whole.found + alone.found, whole.of + alone.of)


def loop_outliers(log: Log, solution: Solution) -> Outliers:
    """Counts the loop closures that do not fit an optimum, likewise."""
    return _beyond(loop_misfits(log, solution.path), LOOP_MEDIAN, LOOP_FAR)


def _beyond(squared: Array, median: float, far: float) -> Outliers:
    if not len(squared):
        return Outliers(0, 0)
    scale = max(1.0, float(np.median(squared)) / median)
    return Outliers(int((squared > far * scale).sum()), len(squared))


def _beside(places: Map, onto: Map) -> Map:
    """Aligns all landmarks, as one, with those that `onto` has too."""
    _, mine, theirs = np.intersect1d(places.ids, onto.ids, return_indices=True)
    if len(mine) < FEWEST:
        return places
    motion = align(places.xy[mine], onto.xy[theirs]).motion
    return places._replace(xy=act(np.broadcast_to(motion, (len(places.ids), 3)), places.xy))


def _found(log: Log) -> Truth | None:
    plain, words = _optimum(log), ""
    solution = None if plain is None or plain.converged is False else plain  # another would be as good a reference
    if solution is None or outliers(log, solution).many or loop_outliers(log, solution).many:
        robust = _optimum(log, loss="cauchy")
        if robust is not None and (solution is not None or robust.converged is not False):
            solution = robust  # which hardly moves where it goes on
            odd = {"sightings": outliers(log, robust), "loop closures": loop_outliers(log, robust)}
            said = " and ".join(f"{one.found} of {one.of} {what}" for what, one in odd.items() if one.of)
            words = f"the batch optimum with a Cauchy loss ({said} do not fit)"
    if solution is None:
        return None
    return Truth(log.t, solution.path, solution.map._replace(cov=None), None, "reference", "reference", words)


def _optimum(log: Log, loss: str = "none") -> Solution | None:
    from ...backends.graphs import graph  # numba

    batch = graph.build.make(log.prior, graph.Options(loss=loss, joint_up_to=0), np.random.default_rng(0))
    for step in log.identified():
        batch.step(step)
    try:
        return batch.finish()
    except Diverged:
        return None


def _key(log: Log) -> str:
    """The cache key: the factors, the code that finds the optimum and the library it uses."""
    total = hashlib.sha256(f"{log.digest} numba {metadata.version('numba')}\n".encode())
    for file in [Path(__file__), *sorted(Path(backends.__file__).parent.rglob("*.py"))]:
        total.update(file.read_bytes())
    return total.hexdigest()
