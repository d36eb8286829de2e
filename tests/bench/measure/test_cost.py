"""J, the survey's cost, term by term: against plain sums over plain numbers, against GTSAM, and who has the least."""

import math
from dataclasses import replace

import gtsam
import numpy as np
import pytest

from driven import NO_SIGHTINGS
from random_logs import random_covariance, random_log
from slamduel.backends import constant_errors
from slamduel.backends.api import Constant
from slamduel.backends.registry import find
from slamduel.bench.measure.drive import drive
from slamduel.bench.measure.misfit import Misfit, misfit
from slamduel.bench.measure.score import score
from slamduel.core.factors import Log, Map, RelativePoses, Systematic
from slamduel.core.fixes import FixTable
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.se2 import Array, Ints


def turned(angle: float) -> float:
    return math.atan2(math.sin(angle), math.cos(angle))


def weighed(error: list[float], cov: Array) -> float:
    """e' C^-1 e."""
    e = np.array(error)
    return float(e @ np.linalg.inv(cov) @ e)


def motion(a: Array, b: Array) -> tuple[float, float, float]:
    """From pose a to pose b, as somebody in a measures it with a ruler along his own axes."""
    far, way = math.hypot(b[0] - a[0], b[1] - a[1]), math.atan2(b[1] - a[1], b[0] - a[0]) - a[2]
    return far * math.cos(way), far * math.sin(way), turned(b[2] - a[2])


def summed_by_hand(log: Log, path: Array, landmarks: Map) -> Misfit:
    """The survey's J_GraphSLAM, each of its sums in a loop."""
    place = dict(zip(landmarks.ids.tolist(), landmarks.xy.tolist(), strict=True))
    start = path[0] - log.prior.pose
    prior = weighed([start[0], start[1], turned(start[2])], log.prior.cov)
    given = log.prior.map
    if given is not None and given.cov is not None:
        moved = [place[i][axis] - given.xy[k, axis] for k, i in enumerate(given.ids.tolist()) for axis in (0, 1)]
        prior += weighed(moved, given.cov)
    odometry = sightings = loops = 0.0
    for k, step in enumerate(log):
        if step.odometry is not None:
            x, y, turn = motion(path[k - 1], path[k])
            dx, dy, dtheta = step.odometry.delta
            odometry += weighed([x - dx, y - dy, turned(turn - dtheta)], step.odometry.cov)
        for i, (r, phi), cov in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            east, north = place[i][0] - path[k, 0], place[i][1] - path[k, 1]
            off = [r - math.hypot(east, north), turned(phi - math.atan2(north, east) + path[k, 2])]
            sightings += weighed(off, cov)
        for to, (dx, dy, dtheta), cov in zip(step.loops.to, step.loops.delta, step.loops.cov, strict=True):
            x, y, turn = motion(path[to], path[k])
            loops += weighed([x - dx, y - dy, turned(turn - dtheta)], cov)
    return Misfit(prior, odometry, sightings, loops)


def with_everything(seed: int) -> tuple[Log, Array, Map]:
    """A log with two loop closures and a given map; a path and a map that are off by centimetres."""
    rng = np.random.default_rng(seed)
    log, truth = random_log(rng, 30, 6)
    given = Map(truth.map.ids[1:4], truth.map.xy[1:4] + 0.05, random_covariance(rng, [0.1] * 6))
    steps = list(log)
    for k, to in ((12, 3), (25, 0)):
        delta = np.array(motion(truth.poses[to], truth.poses[k])) + rng.normal(0, 0.02, 3)
        loop = RelativePoses(np.array([to]), delta[None], random_covariance(rng, [0.1, 0.1, 0.05])[None])
        steps[k] = steps[k]._replace(loops=loop)
    path = truth.poses + rng.normal(0, 0.03, truth.poses.shape)
    landmarks = truth.map._replace(xy=truth.map.xy + rng.normal(0, 0.03, truth.map.xy.shape))
    return Log.from_steps("everything", log.prior._replace(map=given), steps), path, landmarks


@pytest.mark.parametrize("seed", range(3))
def test_every_term_is_the_surveys_sum(seed: int) -> None:
    log, path, landmarks = with_everything(seed)
    found = misfit(log, path, landmarks)
    assert found is not None
    assert min(found) > 0
    np.testing.assert_allclose(found, summed_by_hand(log, path, landmarks), rtol=1e-9)
    assert found.total == pytest.approx(sum(found), rel=1e-15)


def test_it_is_twice_gtsams_error_where_no_residual_turns() -> None:
    """GTSAM measures the misfit of a motion along the arc that leads from one pose to the other: where headings fit, as
    here, that is the straight line; elsewhere the two differ by the product of the misfits in heading and in place."""
    log, path, landmarks = with_everything(7)
    assert log.prior.map is not None
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    names = {i: gtsam.symbol("l", k) for k, i in enumerate(landmarks.ids.tolist())}
    for i, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
        values.insert(names[i], xy)
    path[0, 2] = log.prior.pose[2]
    path[:, 2] = path[0, 2] + np.concatenate(([0.0], np.cumsum(log.delta[1:, 2])))
    path[:, 2] = np.arctan2(np.sin(path[:, 2]), np.cos(path[:, 2]))
    for k, step in enumerate(log):
        values.insert(k, gtsam.Pose2(*path[k]))
        if step.odometry is None:
            graph.add(gtsam.PriorFactorPose2(k, gtsam.Pose2(*log.prior.pose), behind(log.prior.pose, log.prior.cov)))
        else:
            delta, cov = step.odometry
            graph.add(gtsam.BetweenFactorPose2(k - 1, k, gtsam.Pose2(*delta), behind(delta, cov)))
        for i, (r, phi), cov in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            noise = gtsam.noiseModel.Gaussian.Covariance(cov[::-1, ::-1])
            graph.add(gtsam.BearingRangeFactor2D(k, names[i], gtsam.Rot2(phi), r, noise))
    found = misfit(log, path, landmarks)
    bare = misfit(Log.from_steps("without", log.prior._replace(map=None), list(log)), path, landmarks)
    assert found.prior > bare.prior
    assert bare.total - bare.loops == pytest.approx(2 * graph.error(values), rel=1e-9)


def behind(pose: Array, cov: Array) -> gtsam.noiseModel.Gaussian:
    """A covariance given in the axes before a motion, or in the world's, in those of the pose after it."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    R = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return gtsam.noiseModel.Gaussian.Covariance(R @ cov @ R.T)


def test_the_batch_optimum_has_the_least_and_an_online_path_pays_in_odometry() -> None:
    log = random_log(np.random.default_rng(3), 80, 10).log
    terms: dict[str, Array | Ints] = {}
    for name in ("ekf", "fastslam", "isam2", "graph"):
        builder = find(name)
        outcome = drive(builder, builder.options(), log, lambda: np.random.default_rng(0))
        judged = score(log, outcome, None)
        terms[name] = judged.arrays["cost_terms"]
        assert judged.row["cost_j"] == pytest.approx(terms[name].sum(), rel=1e-12)
    least = terms["graph"].sum()
    assert all(found.sum() > least for name, found in terms.items() if name != "graph")
    assert terms["isam2"].sum() == pytest.approx(least, rel=1e-2)
    assert terms["ekf"][1] > terms["graph"][1] + 6 * np.sqrt(2 * terms["graph"][1])


def test_it_is_not_defined_where_a_landmark_that_is_sighted_or_given_was_lost() -> None:
    log, path, landmarks = with_everything(1)
    unseen = Log.from_steps("unseen", log.prior, [step._replace(sightings=NO_SIGHTINGS) for step in log])
    for one, lost in ((log, log.ids[0]), (unseen, log.prior.map.ids[0])):
        kept = landmarks.ids != lost
        assert misfit(one, path, landmarks) is not None
        assert misfit(one, path, Map(landmarks.ids[kept], landmarks.xy[kept], None)) is None
    assert misfit(log, path, Map(NO_SIGHTINGS.ids, NO_SIGHTINGS.z, None)) is None


@pytest.mark.parametrize("each", [False, True])
def test_ranges_bearings_and_fixes_are_terms_with_their_constant_errors(each: bool) -> None:
    log, path, landmarks = with_everything(3)
    n, rng = len(log), np.random.default_rng(4)
    ids = landmarks.ids[[0, 1, 1, 2]]
    kinds, measured = np.array([RANGE, RANGE, BEARING, BEARING]), rng.uniform(1, 3, 4)
    partial = PartialTable.from_arrays(n, np.array([0, 3, 3, 9]), ids, kinds, measured, np.full(4, 0.2))
    z, cov, arm = np.array([1.0, math.nan, 3.1]), np.diag([0.2, math.nan, 0.1]), np.array([0.3, -0.1])
    cov[0, 1] = cov[1, 0] = cov[1, 2] = cov[2, 1] = math.nan
    fixes = FixTable.from_arrays(n, np.array([7]), z[None], cov[None], arm[None])
    systematic = Systematic(0.1, 0.2, 0.3, each)
    more = replace(log, partial=partial, fixes=fixes, prior=log.prior._replace(systematic=systematic))
    size = len(landmarks.ids) if each else 1
    constant = Constant(rng.normal(0, 0.1, size), rng.normal(0, 0.1, size), 0.05)
    place = dict(zip(landmarks.ids.tolist(), landmarks.xy.tolist(), strict=True))
    terms = 0.0
    for k, i, kind, z_i in zip((0, 3, 3, 9), ids.tolist(), kinds, measured, strict=True):
        east, north = place[i][0] - path[k, 0], place[i][1] - path[k, 1]
        row = landmarks.ids.tolist().index(i) if each else 0
        far = (1 + constant.range_scale[row]) * math.hypot(east, north) + constant.range_offset[row] - z_i
        terms += (far if kind == RANGE else turned(math.atan2(north, east) - path[k, 2] - z_i)) ** 2 / 0.2
    heading = path[7, 2]
    known = (path[7, 0] + 0.3 * math.cos(heading) + 0.1 * math.sin(heading) - 1.0) ** 2 / 0.2
    known += turned(heading + 0.05 - 3.1) ** 2 / 0.1
    known += float(sum((constant.range_scale / 0.1) ** 2 + (constant.range_offset / 0.2) ** 2)) + (0.05 / 0.3) ** 2
    plain, found = misfit(log, path, landmarks), misfit(more, path, landmarks, constant)
    assert plain is not None
    assert found is not None
    assert found.sightings - plain.sightings == pytest.approx(terms, rel=1e-9)
    assert found.prior - plain.prior == pytest.approx(known, rel=1e-9)
    least = misfit(more, path, landmarks)
    assert least is not None
    for _ in range(50):
        off = [part + rng.normal(0, 0.02, np.shape(part)) for part in constant_errors.fitted(more, path, landmarks)[:3]]
        other = misfit(more, path, landmarks, Constant(off[0], off[1], float(off[2])))
        assert other is not None
        assert other.total > least.total
