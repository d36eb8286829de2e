"""The incremental smoother, and one whose cost and memory follow the area that the robot drives in, not the time.

With `keep`, the way is divided into stretches of that length. One from which a landmark is seen for the first time
stays as it is, and so do its neighbours: all poses, all motions, all sightings. Another one adds nothing but accuracy.
Its poses are marginalised, and what it told of its landmarks is added to a submap nearby: dense information about
coordinates in the frame of one pose. The motions into such a stretch and out of it are left out, so that it has factors
with landmarks alone. The robot is located anew from the map, and no information is used twice or made up (Walter,
Eustice and Leonard, "Exactly sparse extended information filters for feature-based SLAM", IJRR 26(4), 2007). Within a
stretch nothing is approximated but the point of linearisation. There are as many factors as there are places, and what
is lost are these motions. Kretzschmar and Stachniss (IJRR 31(11), 2012) and Carlevaris-Bianco, Kaess and Eustice (T-RO
30(6), 2014) sparsify what marginalising leaves between poses; here there is nothing between poses.

A loop closure to a marginalised step leads to landmarks again, whose information the submaps have already. So it is
left out where landmarks locate the robot, and so is one to the frame of a submap, or from there. Elsewhere it is
transferred to a kept pose nearby: see `anchored`. When its own step is marginalised it is transferred if it leads to a
held step, see `transfers`, and else left out. Positions and headings in the world are transferred as well: see
`positions`. Where loop closures alone locate the robot, there are no landmarks to be told of:
what stays are the first stretches at each place. So the way at the end is smoothed with all motions and loop
closures: see `way`.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...core.factors import Prior, RelativePoses, Step
from ...core.kernels.compile_ahead import compile_ahead
from ...core.se2 import Array, Ints
from ..api import COMPILED_HERE, Builder, Diverged, Pose, Solution, Unsuited
from ..common_options import without_loss
from ..incremental.smoother import Options, Smoother
from ..smoothing import _log
from ..smoothing._graph import (
    FURTHEST,
    LAST,
    ROOT,
    STEP,
    STEPS,
    SUBMAP,
    VARIABLES,
    WIDTH,
    Graph,
)  # fmt: skip
from ..smoothing.forest import NOBODY
from ._condensed import condense
from ._stretches import ENOUGH, SHORT, nearest, seen_in, sighted_before, stretches
from .anchored import NOWHERE, Anchored, anchors_at
from .compacted import Which, compacted
from .left_out import LeftOut
from .positions import MovedFix, Positions, measured, moved_fixes
from .submaps import Condensed, Submap, begun
from .transfers import Moved, Transfers, link, transferred
from .visits import Visits
from .way import Way

NEWEST = 100  # steps at the end that stay as they are: what follows them still moves them
OFTEN = 1000
"""Steps between two looks for what can be marginalised: fewer than half of all that is kept would cost too much."""

LONGEST = 1000  # steps of a stretch
VISITS = 4  # stretches that stay at a place where loop closures alone locate the robot: docs/smoothing.md has others
NEAR = 0.5  # m for each of `keep`, between the middles of two stretches that have one submap


class Stretch(NamedTuple):
    """Rows of steps that are decided on together."""

    first: int
    last: int
    new: bool  # something is seen for the first time


class Keeping(Smoother):
    """Incremental smoothing with submaps in place of poses from which nothing new is seen."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        lag = "so does fixed-lag, at a bounded cost"
        for there, what, other in (
            (prior.partial, "no sightings that tell a range or a bearing alone", lag),
            (prior.fixes and prior.systematic.heading_offset > 0, "no constant error of a compass", lag),
            (prior.gyro is not None, "no gyro's bias in the state", "gyro=front estimates it in front"),
            (prior.map is not None, "no given map, with which nothing is new", lag),
        ):
            if there:
                raise Unsuited(f"keep={options.keep:g} takes {what}; keep=0 does, and {other}")
        super().__init__(prior, options, rng)
        compile_ahead(f"{__package__}.kernels")
        self.submaps, self._left_out = list[Submap](), LeftOut()
        self._loops, self._anchored, self._transfers = prior.loops, Anchored(), Transfers()
        self._way, self._rng = Way(), rng
        self._fixes, self._positions, self._lost = prior.fixes, Positions(), 0
        self._frames = set[int]()  # steps of the submaps' frames
        self._closed, self._unused = 0, 0  # loop closures, and those that were left out
        self._by_loops = list[Ints]()  # steps that are marginalised where loop closures alone locate the robot
        self._visits = Visits()
        self._numbers = np.zeros(0, np.int64)  # steps of the rows that were there when this was last looked at
        self._known = np.zeros(0, np.bool_)  # variables of landmarks that have been seen in an earlier stretch
        self._begin = 1  # row of the first stretch that has not ended
        self._waiting = list[Stretch]()  # the last one that has
        self._news = True  # the one before that showed something new
        self._next = OFTEN  # rows at which to look next

    def step(self, step: Step) -> Pose:
        """The step of an incremental smoother; from time to time poses are marginalised after it."""
        if self._loops:
            self._way.add(step.odometry, step.loops)
        if len(step.loops.to):
            step = step._replace(loops=self._held_loops(step.loops))
        pose = super().step(step)
        if self.held < self._next:
            return pose
        self._look()
        pose = self._forest.pose.copy()
        if not np.isfinite(pose).all():
            raise Diverged("the latest pose is not finite")
        return pose

    def finish(self) -> Solution:
        """The solution of an incremental smoother; its remark counts what was left out."""
        found = super().finish()
        left_out = list[str]()
        if self._unused:
            left_out.append(f"{self._unused:,} of {self._closed:,} loop closures, to marginalised steps, were left out")
        if self._lost:
            left_out.append(f"{self._lost:,} positions and headings far from such of held steps were left out")
        if not left_out:
            return found
        return found._replace(remark="; ".join(filter(None, (found.remark, *left_out))))

    @property
    def held(self) -> int:
        """The number of steps that it still has motions or sightings of."""
        return int(self._forest.g.state[STEPS])

    def _held_loops(self, loops: RelativePoses) -> RelativePoses:
        """A step's loop closures, those to marginalised steps transferred or left out; `to` has rows that are held."""
        gone = [self._row(to) < 0 or to in self._frames for to in loops.to.tolist()]
        sighted = sighted_before(self._forest.g, self.held - 1)
        self._closed += len(loops.to)
        self._unused += len(loops.to)
        loops = self._anchored.moved(loops, gone, sighted)
        self._unused -= len(loops.to)
        return loops._replace(to=np.array([self._row(to) for to in loops.to.tolist()], np.int64))

    def _row(self, step: int) -> int:
        """The row of a step; -1 if it is marginalised."""
        looked = len(self._numbers)
        if looked == 0 or step > self._numbers[-1]:
            return step - (self._steps - self.held)
        row = int(np.searchsorted(self._numbers, step))
        return row if self._numbers[row] == step else -1

    def _look(self) -> None:
        """Decides on all stretches that have ended but the last one, and marginalises those that show nothing new."""
        g = self._forest.g
        rows = int(g.state[STEPS])
        self._known = np.concatenate((self._known, np.zeros(int(g.state[VARIABLES]) - len(self._known), np.bool_)))
        self._numbers = np.concatenate((self._numbers, np.arange(self._steps - rows + len(self._numbers), self._steps)))
        ended, gone = self._waiting, list[tuple[int, int]]()
        ends = stretches(g, self._begin, rows - NEWEST, self._options.keep, LONGEST, self._centres(g), self._loops)
        for end in ends.tolist():
            ended.append(Stretch(self._begin, end, self._is_new(self._begin, end)))
            self._begin = end + 1
        for this, after in pairwise(ended):
            if not (self._news or this.new or after.new):
                gone.append((this.first, this.last))
            self._news = this.new
        self._waiting = ended[-1:]
        if gone:
            self._marginalise(gone)
        self._next = self.held + max(OFTEN, self._begin // 2)

    def _is_new(self, first: int, last: int) -> bool:
        """Tells if a landmark is seen for the first time in these rows, or held back; from now on it is known.

        Where loop closures alone locate the robot, it is new if it has not been there often enough.
        """
        seen, held = seen_in(self._forest.g, first, last)
        new = held or not self._known[seen].all()
        self._known[seen] = True
        if self._loops and len(seen) < ENOUGH:
            g = self._forest.g
            new = new or self._fixes or self._visits.of(g, self._row, first, last) < VISITS
            if new:
                self._visits.add(int(self._numbers[first]), int(self._numbers[last]))
        return new

    def _marginalise(self, gone: list[tuple[int, int]]) -> None:
        """Marginalises stretches, first and last rows, at the present estimate."""
        forest = self._forest
        forest.relinearise(0.0)
        estimate = forest.estimate()
        g, path = forest.g, estimate.path
        self._left_out.begin(estimate.values[g.variables[: len(estimate.values), WIDTH] == 2, :2])
        keeps, frames = np.ones(len(path), np.bool_), np.zeros(len(path), np.bool_)
        held = self._held_rows(g, len(path), gone)
        rows_held = np.flatnonzero(held) if self._loops or self._fixes else NOBODY
        at = rows_held, self._numbers[rows_held], path[rows_held]
        anchors, sighted = (anchors_at(g, *at, loops=loops) for loops in (True, False))
        moved, fixes = list[Moved](), list[MovedFix]()
        fixed = sighted.some([len(measured(g, v)) > 0 for v in sighted.variables.tolist()] if self._fixes else None)
        for first, last in gone:
            middle = path[(first + last) // 2, :2]
            landmarks, _ = seen_in(g, first, last)
            by_loops = self._loops and len(landmarks) < ENOUGH
            index = -1 if by_loops else self._nearest(g, middle)
            n, begins = 2 * len(landmarks), index == len(self.submaps)
            W, h, left = np.zeros((n, n)), np.zeros(n), np.zeros((last - first + 1, 3, 3))
            constant = condense(g, first, last, landmarks, begins, by_loops, W, h, left)
            every = np.arange(first, last + 1)
            rows = every[:-1] if begins else every
            near = anchors.nearest(path[every], SHORT * self._options.keep) if self._loops else NOBODY
            if not np.isfinite(constant) or (by_loops and (near == NOWHERE).any()):  # it stays as it is
                continue
            if by_loops:
                self._by_loops.append(self._numbers[rows])
            else:
                told = Condensed(landmarks, W, h, constant)
                if begins:
                    v = int(g.at[last])
                    self._frames.add(int(self._numbers[last]))
                    self.submaps.append(begun(v, told, g.values[v], g.values, left[-1], middle))
                else:
                    self.submaps[index].add(told, g.values[self.submaps[index].frame], g.values)
                self._left_out.add(self._numbers[rows], index, path[rows], left[: len(rows)])
                if self._loops:
                    reach = SHORT * self._options.keep
                    moved += transferred(g, first, last, path, left, held, sighted, reach)
                if self._fixes:
                    found, lost = moved_fixes(g, first, last, path, left, fixed, self._options.keep)
                    fixes, self._lost = fixes + found, self._lost + lost
            if self._loops:
                self._anchored.add(self._numbers[every], anchors, near, path[every], left)
                self._anchored.redirect(g, self._numbers[every], every, self._row)
            keeps[rows] = False
        for _, last in gone:
            if not keeps[last] and last + 1 < len(keeps) and keeps[last + 1]:
                self._begin_at(last + 1)
        frames[[forest.g.variables[submap.frame, STEP] for submap in self.submaps]] = True
        for one in moved:
            self._transfer(one)
        for fix in fixes:
            self._positions.add(forest.g, fix, int(self._numbers[fix.by]), path[fix.by])
        self._renumber(keeps, frames)

    def _held_rows(self, g: Graph, n: int, gone: list[tuple[int, int]]) -> Which:
        """Tells of n rows which poses stay for ever, and are variables; the frames of submaps apart."""
        stay = (np.arange(n) < (self._waiting[0].first if self._waiting else 0)) & (g.at[:n] >= 0)
        stay[stay] = g.variables[g.at[:n][stay], SUBMAP] == 0
        for first, last in gone:
            stay[first : last + 1] = False
        return stay

    def _transfer(self, moved: Moved) -> None:
        """Adds a loop closure that was transferred to held rows, to that of the same two if there is one."""
        forest = self._forest
        delta, cov = self._transfers.add(moved, (int(self._numbers[moved.to]), int(self._numbers[moved.by])))
        forest.room(0, 0, 0, 1, 0)
        link(forest.g, int(forest.g.at[moved.to]), int(forest.g.at[moved.by]), delta, cov)

    def _begin_at(self, row: int) -> None:
        """Makes the pose of a row, which no motion will lead to, a variable."""
        forest = self._forest
        if forest.g.at[row] < 0:
            forest.room(0, 1, 0, 1, 0)
            _log.split(forest.g, row)

    def _centres(self, g: Graph) -> Array:
        """(n, 2) the middles of the stretches that the submaps were made for."""
        return np.array([of.middle_at(g.values[of.frame]) for of in self.submaps]).reshape(-1, 2)

    def _nearest(self, g: Graph, middle: Array) -> int:
        """The submap of the stretch whose middle is nearest to this one (2,); their number if none is near."""
        centres = self._centres(g)
        best = nearest(middle[0], middle[1], centres)
        far = NEAR * self._options.keep
        return best if best >= 0 and np.hypot(*(centres[best] - middle)) <= far else len(centres)

    def _renumber(self, keeps: Which, frames: Which) -> None:
        """Puts the tables that are left in place of the present ones, and eliminates everything."""
        forest, state = self._forest, self._forest.g.state
        root = forest.g.root[: state[ROOT]].copy()
        last = int(state[LAST])
        new = compacted(forest.g, keeps, frames, self.submaps)
        forest.g = new.g
        for landmark, v in self._variable.items():
            self._variable[landmark] = int(new.variables[v])
        self._near = np.fromiter(self._variable.values(), np.int64, len(self._variable))
        self._parts.renumbered(new.variables)
        self._newest = int(new.variables[self._newest])
        for rows in self._held.values():
            rows[:] = [int(new.sightings[row]) for row in rows if new.sightings[row] >= 0]
        more = np.zeros(len(new.variables) - len(self._known), np.bool_)
        self._known, self._numbers = np.concatenate((self._known, more))[new.variables >= 0], self._numbers[keeps]
        fewer = np.concatenate(([0], np.cumsum(~keeps)))
        self._begin -= int(fewer[self._begin])
        self._waiting = [
            of._replace(first=of.first - int(fewer[of.first]), last=of.last - int(fewer[of.last]))
            for of in self._waiting
        ]
        forest.reorganise(int(new.variables[last]), new.variables[root], everything=True)

    def _whole(self, path: Array, values: Array) -> tuple[Array, Array]:
        """The path (n, 3) and covariances (n, 3, 3) of all steps, from the `path` of those that are left.

        What is marginalised has moved with the landmarks around it since.
        """
        left, g, rows = self._forest.pose_covariances(), self._forest.g, len(path)
        numbers = np.concatenate((self._numbers, np.arange(self._steps - rows + len(self._numbers), self._steps)))
        out, covs = np.empty((self._steps, 3)), np.empty((self._steps, 3, 3))
        out[numbers], covs[numbers] = path, left
        if self._by_loops:
            self._anchored.fill(np.concatenate(self._by_loops), out, covs)
        if self.submaps:
            at = [int(g.variables[submap.frame, STEP]) for submap in self.submaps]
            shared = np.array([left[row] - of.own_at(path[row]) for row, of in zip(at, self.submaps, strict=True)])
            landmarks = g.variables[: len(values), WIDTH] == 2
            row = np.cumsum(landmarks) - 1
            around = [row[of.landmarks] for of in self.submaps]
            self._left_out.fill(out, covs, values[landmarks, :2], around, path[at], shared, g.settings[FURTHEST])
        if self._by_loops:
            self._smooth(out, covs)
        return out, covs

    def _smooth(self, path: Array, covs: Array) -> None:
        """Moves the poses of a path (n, 3) that loop closures alone locate to the minimum of J, the others given.

        Without landmarks all are moved but the first, which is where the prior says, and their covariances (n, 3, 3)
        are those at the minimum.
        """
        free = np.full(self._steps, len(self._variable) == 0)
        free[np.concatenate(self._by_loops)], free[0] = True, False
        factors = self._way.factors(free, self._forest.g.settings)
        found = factors.smoothed(path)
        if found is None:
            return
        path[:] = found
        if len(self._variable) == 0:
            G = np.tile(np.eye(3), (len(path), 1, 1))
            G[:, 0, 2], G[:, 1, 2] = path[0, 1] - path[:, 1], path[:, 0] - path[0, 0]
            covs[:] = factors.covariances(self._rng) + G @ self._prior.cov @ G.transpose(0, 2, 1)


def make(prior: Prior, options: Options, rng: np.random.Generator) -> Smoother:
    """Incremental smoothing, by this package: a causal pose each step, the smoothed path and map at the end."""
    return (Keeping if options.keep else Smoother)(prior, options, rng)


def exact(options: Options) -> bool:
    """True if the end is the minimum of J."""
    return without_loss(options) and not options.keep


build = Builder(
    make,
    options=Options,
    loops=True,
    partial=True,
    fixes=True,
    gyro=True,
    minimises=exact,
    implementation=COMPILED_HERE,
    expects=True,
)
