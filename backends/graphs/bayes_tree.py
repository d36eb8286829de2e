"""GTSAM's Bayes tree, which gives way to QR where Cholesky fails, and whose J is judged with partial sightings.

On logs of partial sightings J is looked at where a landmark starts, where the backend asks for it, and at the end:
damped steps replace an update that raises it, which is not iSAM2, and happens nowhere else. Where the undamped step
that follows raises J again, the estimate stays where the tree is linear.
"""

from dataclasses import dataclass

import gtsam

from ...core.options import option
from ...core.se2 import Array
from .. import common_options
from ..api import Diverged
from ._gtsam import failure
from .gtsam_parts import FAILURES
from .neighbourhood import Neighbourhood

SETTLING = 10
"""Most updates where a landmark of partial sightings starts."""

DAMPED, FLAT = 100, 1e-7
"""Most damped steps there, and the share of J by which the last one lowers it."""

NO_FACTORS, NO_VALUES = gtsam.NonlinearFactorGraph(), gtsam.Values()


@dataclass(frozen=True)
class TreeOptions:
    """When variables are relinearized, and how factors are eliminated."""

    relinearize_threshold: float = common_options.relinearize_threshold()
    relinearize_skip: int = option(
        50, "steps between checks for variables to relinearize; fewer with a gyro's bias in the state", minimum=1
    )
    partial_check: bool = option(False, "look for variables to relinearize from the root down, no further than needed")
    factorization: str = option(
        "auto",
        "cholesky is GTSAM's own default and costs less, but fails where little is known; qr does not; auto: cholesky "
        "until it fails, and then all steps so far once more by qr, which serves from there",
        choices=("auto", "cholesky", "qr"),
    )
    final_updates: int = option(10, "most updates without new factors made at the end of the log", minimum=0)


class BayesTree:
    """The tree of all factors so far, and the marginals around the last pose that are carried along."""

    def __init__(self, options: TreeOptions) -> None:
        self._options, self._factorization = options, "qr" if options.factorization == "qr" else "cholesky"
        self._updates = list[tuple[gtsam.NonlinearFactorGraph, gtsam.Values, bool]]()  # of the tree, until it fails
        self._threshold = options.relinearize_threshold
        self.gave_way = ""  # where Cholesky failed
        self.done = 0  # updates of the tree
        self.steps = 0  # of the log, so far
        self.partly = False  # partial sightings so far: J is judged
        self.stays = False  # the estimate is where the tree is linear: the undamped step raises J
        self.isam = self._empty()
        self.around = Neighbourhood(self.isam)

    def update(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, *, relinearize: bool = False) -> int:
        """Adds factors, and returns the number of variables that were relinearized."""
        self._note(graph, values, relinearize=relinearize)
        kept = None
        if self.stays and not relinearize:  # no check may move what stays
            kept = gtsam.KeyList()
            for key in self.isam.getLinearizationPoint().keys():  # noqa: SIM118 - it is no dict
                kept.push_back(key)
        try:
            return self.isam.update(
                graph, values, force_relinearize=relinearize, noRelinKeys=kept
            ).getVariablesRelinearized()
        except FAILURES as error:
            return self._give_way(error)

    def start(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
        """Adds a step that starts a landmark, and relinearizes until nothing moves.

        The sightings that were held back are from poses that may be far off by them: where J is no lower after an
        update, or the factorization fails, all is optimized from before it by damped steps, and is a new tree.
        """
        everything, before = self._graph(), self.estimate()
        everything.push_back(graph)
        before.insert(values)
        if not self._settles(graph, values, everything.error(before)):
            self._renew(everything, before)

    def look(self) -> None:
        """Makes damped steps where J is higher at the tree's estimate than where the tree is linear."""
        self.stays = False
        if not self._lower():
            self._renew(self._graph(), gtsam.Values(self.isam.getLinearizationPoint()))

    def settled(self, times: int = 1) -> tuple[bool | None, gtsam.Values]:
        """True if relinearization has ended, None without any, and the best estimate then.

        With partial sightings it may lead to a higher J: damped steps go from the lower one.
        """
        converged, before = None, self.estimate() if self.partly else NO_VALUES
        for _ in range(times * self._options.final_updates):
            converged = self.update(NO_FACTORS, NO_VALUES, relinearize=True) == 0
            if converged:
                break
        if self.partly:
            graph = self._graph()
            if not graph.error(self.estimate()) <= graph.error(before):
                self._renew(graph, before)
                converged = not self.stays and self.update(NO_FACTORS, NO_VALUES, relinearize=True) == 0
        return converged, self.estimate()

    def refined(self, values: gtsam.Values, threshold: float, times: int) -> tuple[bool | None, gtsam.Values]:
        """As `settled`, of a new tree with that relinearize threshold from `values`; kept if its J is lower.

        Else False and `values`.
        """
        graph, before = self.isam.getFactorsUnsafe(), self.isam
        self._threshold = threshold
        self.isam = self._empty()
        self._updates.clear()
        try:
            self.update(graph, values)
            converged, found = self.settled(times)
        except Diverged:
            converged, found = None, values
        if graph.error(found) < graph.error(values):
            return converged, found
        self.isam = before
        return False, values

    def estimate(self) -> gtsam.Values:
        """All variables, by full back-substitution, or where the tree is linear if the estimate stays there."""
        if self.stays:
            return gtsam.Values(self.isam.getLinearizationPoint())
        try:
            return self.isam.calculateBestEstimate()
        except FAILURES as error:
            raise Diverged(failure(error)) from None

    def marginal(self, key: int) -> gtsam.GaussianConditional:
        """Marginal of a variable's offset x from its linearisation point, |R x - d|^2, R upper triangular."""
        try:
            return self.isam.marginalFactor(key)
        except FAILURES as error:
            if self._factorization == "cholesky":
                self._give_way(error)
        try:
            return self.isam.marginalFactor(key)
        except FAILURES:  # GTSAM takes Cholesky for a marginal, whatever the tree is made by
            return self.by_qr(key)

    def by_qr(self, key: int) -> gtsam.GaussianConditional:
        """The marginal of a variable by QR throughout."""
        try:
            return self.isam.marginalFactor(key, gtsam.EliminateQR)
        except FAILURES as error:
            raise Diverged(failure(error)) from None

    def joint(self, landmarks: list[int], pose: int) -> tuple[Array, Array]:
        """As `Neighbourhood.joint`."""
        try:
            return self.around.joint(landmarks, pose)
        except FAILURES as error:
            self._give_way(error)
            return self.around.joint(landmarks, pose)

    def _settles(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, cost: float) -> bool:
        """Updates until nothing moves; False where J, which was `cost`, rises, or the factorization fails."""
        self._note(graph, values, relinearize=False)
        self.stays = False
        try:
            self.isam.update(graph, values)
            for _ in range(SETTLING):
                last, cost = cost, self.isam.getFactorsUnsafe().error(self.isam.calculateBestEstimate())
                if not cost <= last:
                    return False
                self._note(NO_FACTORS, NO_VALUES, relinearize=True)
                if not self.isam.update(NO_FACTORS, NO_VALUES, force_relinearize=True).getVariablesRelinearized():
                    break
        except FAILURES:
            return False
        return True

    def _lower(self) -> bool:
        """Tells if J is no higher at the tree's estimate than where the tree is linear."""
        graph = self.isam.getFactorsUnsafe()
        return graph.error(self.estimate()) <= graph.error(self.isam.getLinearizationPoint())

    def _renew(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
        """Makes a new tree of these factors, where damped steps from `values` lead."""
        found = damped(graph, values)
        self.isam, self.stays = self._empty(), False
        self._updates.clear()
        self.update(graph, found)
        self.stays = not self._lower()
        self.around = Neighbourhood(self.isam)

    def _graph(self) -> gtsam.NonlinearFactorGraph:
        """All factors so far."""
        graph = gtsam.NonlinearFactorGraph()
        graph.push_back(self.isam.getFactorsUnsafe())
        return graph

    def _empty(self) -> gtsam.ISAM2:
        """An empty Bayes tree."""
        self.done = 0
        return gtsam.ISAM2(parameters(self._options, self._threshold, self._factorization))

    def _note(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, *, relinearize: bool) -> None:
        """Counts an update, and keeps it for when Cholesky fails."""
        self.done += 1
        if self._options.factorization == "auto" and not self.gave_way:
            self._updates.append((graph, values, relinearize))

    def _give_way(self, error: Exception) -> int:
        """Does, after Cholesky has failed, all updates so far once more by QR, the failed one the last.

        A tree of the factors at the points of the failing one would be cheaper, but these may be far off: on one log
        in ten it ended at another minimum. Returns the number of variables, which are all linearized anew.
        """
        if self.gave_way or self._options.factorization != "auto":
            raise Diverged(failure(error)) from None
        self.gave_way = f"GTSAM's Cholesky factorization failed at step {self.steps}: QR from there"
        self._factorization = "qr"
        self.isam = self._empty()
        for graph, values, relinearize in self._updates:
            self.update(graph, values, relinearize=relinearize)
        self._updates.clear()
        self.around = Neighbourhood(self.isam)
        return self.isam.getLinearizationPoint().size()


def damped(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.Values:
    """A lower J, by Levenberg and Marquardt's method."""
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(DAMPED)
    params.setRelativeErrorTol(FLAT)
    try:
        return gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
    except FAILURES as error:
        raise Diverged(failure(error)) from None


def parameters(options: TreeOptions, threshold: float, factorization: str) -> gtsam.ISAM2Params:
    """GTSAM's parameters, with that relinearize threshold and factorization."""
    params = gtsam.ISAM2Params()
    params.setRelinearizeThreshold(threshold)
    params.relinearizeSkip = options.relinearize_skip
    params.enablePartialRelinearizationCheck = options.partial_check
    params.setFactorization(factorization.upper())
    # Always back-substitute in full: results then do not depend on earlier queries.
    params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(0.0))
    return params
