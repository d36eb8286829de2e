"""A whole log as GTSAM's native factors, made at once: covariances are converted for all of a kind together."""

import gtsam
import numpy as np

from ...core.factors import Log
from ...core.partial import RANGE, PartialTable
from ...core.se2 import Array
from ...core.truth.errors import rows_of
from ..models import place
from ..starting.late_places import Seen
from ._gtsam import BYTES, NEAREST, Factors, in_order, turned
from .batch import chunks
from .gtsam_parts import fix_factors, part_factor
from .parts import place_of


def whole(factors: Factors, log: Log, path: Array) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """All factors, and initial values: poses at `path` (n, 3), landmarks where first sighted from there.

    Sightings and loop closures have the loss of `factors`, which names the variables.
    """
    graph, values = factors.prior()
    first = factors.keys.pose(0)
    values.update(first, gtsam.Pose2(*path[0].tolist()))
    for k, (x, y, heading) in enumerate(path[1:].tolist(), first + 1):
        values.insert(j=k, pose2=gtsam.Pose2(x, y, heading))  # by name: else GTSAM tries four conversions first
    between, Pose2, covariance = gtsam.BetweenFactorPose2, gtsam.Pose2, gtsam.noiseModel.Gaussian.Covariance
    delta = log.delta[1:]
    for k, ((x, y, turn), cov) in enumerate(zip(delta.tolist(), turned(delta, log.delta_cov[1:]), strict=True), first):
        graph.add(between(k, k + 1, Pose2(x, y, turn), covariance(cov)))
    ends = np.column_stack((first + log.loop_to, first + log.loop_step)).tolist()
    rows = zip(ends, log.loop_delta.tolist(), turned(log.loop_delta, log.loop_cov), strict=True)
    for (to, at), (x, y, turn), cov in rows:
        graph.add(between(to, at, Pose2(x, y, turn), factors.weighed(covariance(cov))))
    if len(log.ids):
        _add_sightings(factors, log, path, graph, values)
    for k in range(len(log)) if log.fixes is not None else ():
        fixes = log[k].fixes
        for one in fix_factors(first + k, factors.constant.heading(graph, values), fixes) if len(fixes.z) else ():
            graph.add(one)
    if log.gyro is not None:
        for step, turn in log.gyro.by_step().items():
            factors.biases.add(first + step, turn, None, graph, values)
    if log.partial is not None:
        _add_parts(factors, log, log.partial, path, graph, values)
    return graph, values


def _add_parts(
    factors: Factors,
    log: Log,
    table: PartialTable,
    path: Array,
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
) -> None:
    """Adds partial sightings, and landmarks of these alone where those until the end of a chunk place them first."""
    ends, covs = chunks(log), log.delta_cov
    for landmark in np.unique(table.ids).tolist():
        if landmark in factors.keys.landmarks:
            continue
        tried = (place_of(table, landmark, path[:end], covs, last=end == len(path)) for end in ends)
        values.insert(factors.keys.landmark(landmark), next(xy for xy in tried if xy is not None))
    columns = table.step, table.ids, table.kind, table.z, table.var
    for step, landmark, kind, z, var in zip(*(column.tolist() for column in columns), strict=True):
        errors = factors.constant.of(landmark, graph, values) if kind == RANGE else None
        ends_at = factors.keys.pose(step), factors.keys.landmarks[landmark]
        graph.add(part_factor(*ends_at, errors, Seen(step, kind, z, var), factors.weighed))


def _add_sightings(
    factors: Factors, log: Log, path: Array, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values
) -> None:
    """Adds the sightings, and initial values of landmarks that have none."""
    ids, at = np.unique(log.ids, return_index=True)
    z = np.column_stack((np.maximum(log.z[at, 0], NEAREST), log.z[at, 1]))
    places, known = place(path[log.sighting_step[at]], z)[0], set(factors.keys.landmarks)
    for k in np.argsort(at).tolist():
        landmark = int(ids[k])
        key = factors.keys.landmark(landmark)
        if landmark not in known:
            values.insert(key, places[k])
    keys = np.array([factors.keys.landmarks[i] for i in ids.tolist()])
    ends = np.column_stack((factors.keys.pose(0) + log.sighting_step, keys[rows_of(ids, log.ids)])).tolist()
    covs, factor, Rot2 = in_order(log.z_cov), gtsam.BearingRangeFactor2D, gtsam.Rot2
    for i, ((pose, landmark), (distance, bearing)) in enumerate(zip(ends, log.z.tolist(), strict=True)):
        graph.add(factor(pose, landmark, Rot2(bearing), distance, factors.noise(covs[BYTES * i : BYTES * (i + 1)])))
