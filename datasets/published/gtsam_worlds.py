"""Simulated pose graphs in the gtsam wheel, whose truth is known as their robots walk on a grid.

w10000 is of TORO (G. Grisetti et al., 2009) and has no truth, w20000 neither: but rounded to whole metres and quarter
turns, all 54,312 and all 6,771 loop closures agree with the motions, which gives the true walk. The noise that their
numbers have is not what they state: information of 1, and roots of information of 3.16 and 5. The 5,875 EQUIV rows of
w10000, of poses in one place, are not used.

T1_city10000_04 is City10000 (M. Kaess et al., iSAM2, 2012) with a second, false measurement of 200 motions, from
GTSAM's hybrid estimation; the first of each is right, as GTSAM does not say.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...core.factors import REMARKS, Dataset, Truth
from ...core.options import option
from ...core.se2 import Array
from ...core.table import read_spaced
from ..false_loops import FalseLoops
from ..formats import gtsam_text
from ..graphs.grid_walk import MEASURED, nearest, walked
from ..graphs.hypotheses import ALL, CHOICES, log_and_truth, read_hypotheses
from ..redrawn import Drawn
from ..registry import Source

FILE, OWN = NOISES = ("file", "true")

AMBIGUOUS, ESTIMATED = "T1_city10000_04.txt", "ISAM2_GT_city10000.txt"
CITY_SD = (0.02, 0.02, 0.01)
"""m, m, rad: what City10000 states and its numbers have. GTSAM's examples take 1/30, 1/30 and 1/100 or 1/20."""

OFF = 1e-3  # m and rad: an estimate that is farther from the grid is of another walk

_LICENCE = "that of GTSAM, in whose package it is: BSD"


@dataclass(frozen=True)
class Walk(Drawn, FalseLoops):
    """The covariances."""

    noise: str = option(FILE, "covariances: as in the file, or of the noise that its numbers have", choices=NOISES)


@dataclass(frozen=True)
class Ambiguous(Drawn):
    """Which graph, and which hypotheses."""

    ambiguous: str = option(
        ALL, "hypotheses of a motion: all, the others as loop closures; the first; the true one", choices=CHOICES
    )
    path: str | None = option(None, "another file of that format; not given: the one that ships with GTSAM")
    truth: str | None = option(None, "its true poses, x y heading, on a grid, a row each; not given: those of GTSAM")


def _walk(name: str, file: str, kind: str, sd: tuple[float, float, float], summary: str) -> Source:
    def make(options: Walk, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
        path = gtsam_text.shipped(file)
        notes = {
            "source": f"{file} as shipped with GTSAM",
            "licence": _LICENCE,
            "truth": "the walk on a grid that all edges agree with",
            "noise": f"{sd[0]:g} m and {sd[2]:g} rad by its numbers",
        }
        log = gtsam_text.read(path, kind, name, notes, _diagonal(sd) if options.noise == OWN else None).log
        log = replace(log, notes={key: note for key, note in log.notes.items() if key != REMARKS})  # EQUIV, see above
        poses = walked(gtsam_text.read_tables(path)["edges"], MEASURED).poses
        return Dataset(log, Truth(log.t, poses))

    make.__doc__ = summary
    return Source(make, Walk)


def ambiguous(options: Ambiguous, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """City10000 with a false second measurement of 200 motions: 10,000 poses, 10,688 loop closures, true path."""
    path, right = _files(options)
    found = read_hypotheses(path)
    notes = {"source": f"{path.name} as shipped with GTSAM", "licence": _LICENCE}
    notes["covariances"] = "none in the file: as City10000 states them"
    return log_and_truth(found, _true_poses(right), _diagonal(CITY_SD), options.ambiguous, "city10000-ambiguous", notes)


def _files(options: Ambiguous) -> Sequence[Path]:
    given = (options.path, AMBIGUOUS), (options.truth, ESTIMATED)
    return [gtsam_text.shipped(file) if path is None else Path(path) for path, file in given]


def _true_poses(path: Path) -> Array:
    """The poses of the grid near the estimates in `path`; InputError for one that is none."""
    table = read_spaced(path, ("x", "y", "heading")).finite()
    poses = nearest(table.rows)
    off = table.rows - poses
    off[:, 2] -= 2 * np.pi * np.rint(off[:, 2] / (2 * np.pi))
    for row in np.flatnonzero(np.abs(off).max(axis=1) > OFF):
        raise table.fault(row, "the pose is not on a grid of whole metres and quarter turns")
    return poses


def _diagonal(sd: tuple[float, float, float]) -> Array:
    return np.diag(np.square(sd))


w10000 = _walk(
    "w10000", "w10000.graph", "graph", (0.05, 0.05, 0.02),
    "w10000: TORO's simulated walk, 10,000 poses, 54,312 loop closures, true path; its stated noise is far too large.",
)  # fmt: skip
w20000 = _walk(
    "w20000", "w20000.txt", "root", (0.1, 0.1, 0.04),
    "w20000: a simulated walk, 20,061 poses, 6,771 loop closures, true path; its stated noise is too large.",
)  # fmt: skip
city10000_ambiguous = Source(ambiguous, Ambiguous, files=_files)
