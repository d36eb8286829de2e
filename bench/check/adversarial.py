"""Checks a backend on fifty hard logs: it ends finite and near the batch answer, or says why it cannot.

The batch answer is `graph`'s optimum of J, or the truth where `graph` itself gives up or finds no better J than that.
An estimate may be off it by SIGMAS standard deviations of a Kalman filter that is linearised along it:

- The difference of an estimate from the factors up to step k and one from all of them has the covariance Pk - Pn, so
  the filter's Pk bounds it for every causal estimate, and for every smoothed one all the more.
- Filters that linearise elsewhere differ in the second order, which is added to the noises. With s the spread of
  landmark less robot and q that of the sighting itself (m), it is s^2 / r, sqrt(m) fold at the m-th sighting of a
  landmark because it does not average out, and s q / r; for a motion of length d and heading spread h, d h^2, sqrt(m)
  fold at the m-th motion, and q h.
- The covariance of dead reckoning holds for a backend that ignores sightings (found on an ordinary log), for one that
  forgets landmarks, which of a place seen again knows only what dead reckoning brings along, and for a `linear` one,
  which turns sightings by a heading that is not its estimate. Particle filters are given twice that covariance: their
  path is a sample, as is what they estimate.
- Where an error larger than stated was planted, m standard deviations of it move an estimate by m of its own
  (K R K' <= P), so SIGMAS becomes SIGMAS + m.
"""

import warnings
from collections import Counter
from dataclasses import replace
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...backends.api import UNKNOWN, Diverged, Unsuited
from ...backends.given import refused
from ...core import se2
from ...core.factors import Map, RangeBearing
from ...core.se2 import Array, Ints
from ..measure.misfit import misfit
from ..plan.reference import reference
from ..words.numerals import counted
from .adversarial_logs import ADVERSARIES, Adversary
from .candidate import ROUNDING, SIGMAS, Candidate, Failed, GaveUp, NotApplicable, Trial, stays_near
from .log_recipe import made_log
from .small_logs import SmallLog, around, dead_reckoned

DIGITS = 1e-9  # share of the coordinates' size that rounding and early-stopped iterations may add up to


class BatchAnswer(NamedTuple):
    """The batch answer of a log, and the uncertainty of an estimate on the way to it."""

    path: Array  # (n, 3)
    cov: Array  # (n, 3, 3) of a filter that linearises along that path
    reckoned: Array  # (n, 3, 3) of dead reckoning
    batch: bool  # the path is the batch answer, else the truth


def ends_near_the_batch_answer(candidate: Candidate, adversary: Adversary) -> str:
    """Checks `candidate` on one of the logs; returns its finding as a sentence.

    Raises Failed with one; GaveUp where the backend raised Diverged and the log allows for that; and whatever else the
    backend raises.
    """
    log = adversary.made.log
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # an overflow shows in the answer, or is none
            trial = candidate.run(log)
    except Diverged as reason:
        if adversary.may_end:
            raise GaveUp(f"{reason} (allowed here: {adversary.may_end})") from None
        raise Failed(f"it gave up: {reason}; expected it done on this log") from None
    paths = trial.paths
    chooses = candidate.associates or trial.takes_out  # on such a log a landmark that stands may look as if it moved
    if len(ordinary(candidate).final_map.ids) and not chooses:
        _holds(trial.final_map, set(log.ids.tolist()))
    for which, landmarks in {"map()": trial.map, "the final map": trial.final_map}.items():
        _is_finite(landmarks, which)
    answer = batch_answer(adversary)
    allowed = bound(candidate, adversary, answer, trial.takes_out)
    what = "batch answer" if answer.batch else "truth"
    off = max(stays_near(path, answer.path, allowed, f"the {which} path") for which, path in paths.items())
    steps = counted(len(log), "step")
    return f"at most {off:.2g} m from the {what} in {steps}, where up to {allowed[0].max():.2g} m may be"


def stands_logs_without_ids(candidate: Candidate) -> str:
    """One that does data association ends finite on the hard logs without ids, or says why it cannot."""
    if not candidate.associates:
        raise NotApplicable("sightings without id are taken out before it sees the log")
    ended = 0
    for adversary in ADVERSARIES:
        log = adversary.made.log
        if refused(candidate.builder, log):
            continue
        hidden = replace(log, ids=np.full(len(log.ids), UNKNOWN))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                trial = candidate.run(hidden)
        except Diverged:
            ended += 1
            continue
        except Unsuited as reason:
            raise NotApplicable(str(reason)) from None
        for which, path in trial.paths.items():
            if not np.isfinite(path).all():
                raise Failed(f"{adversary.name}: the {which} path is not finite")
        _is_finite(trial.final_map, f"{adversary.name}: the final map")
    return f"{len(ADVERSARIES)} logs, given up with a reason on {ended}"


def bound(
    candidate: Candidate, adversary: Adversary, answer: BatchAnswer, takes_out: bool = False
) -> tuple[Array, Array]:
    """Bounds the error, (n,) m and (n,) rad, of an estimate relative to the batch answer.

    One that takes out sightings which are off may take out most on such a log: it is held to dead reckoning's bound.
    """
    log, cov = adversary.made.log, answer.cov
    built = candidate.builder
    if built.forgets or built.linear or takes_out or not uses_sightings(ordinary(candidate)):
        cov = answer.reckoned
    elif built.random:
        cov = 2 * answer.reckoned
    sigmas = SIGMAS + adversary.planted
    size = np.abs(answer.path[:, :2]).max() + (log.z[:, 0].max() if len(log.z) else 0.0)
    place = np.linalg.eigvalsh(cov[:, :2, :2])[:, -1]
    return sigmas * np.sqrt(place) + ROUNDING + DIGITS * size, sigmas * np.sqrt(cov[:, 2, 2]) + ROUNDING


def uses_sightings(trial: Trial) -> bool:
    """True if sightings made a difference to a backend on the ordinary log."""
    plain, _ = dead_reckoned(_ORDINARY.log)
    return any(np.abs(path - plain).max() > ROUNDING for path in trial.paths.values())


_ORDINARY = made_log(np.random.default_rng(31), around(30))


@lru_cache(maxsize=1)
def ordinary(candidate: Candidate) -> Trial:
    """Runs a backend on a log with nothing hard about it."""
    return candidate.run(_ORDINARY.log)


@cache
def batch_answer(adversary: Adversary) -> BatchAnswer:
    """The answer that every backend is compared with; the optimum is kept in the user's cache."""
    made = adversary.made
    found = reference(made.log)
    along, batch = made, False
    if found is not None and found.map is not None and _fits(made, found.poses, found.map):
        along, batch = SmallLog(made.log, found.poses, found.map), True
    return BatchAnswer(along.path, filtered(along), filtered(along, blind=True), batch)


def _fits(made: SmallLog, path: Array, landmarks: Map) -> bool:
    """True if J is no larger than that of the truth: else the optimum is elsewhere."""
    here, there = misfit(made.log, path, landmarks), misfit(made.log, made.path, made.map)
    return here is not None and there is not None and here.total <= there.total + ROUNDING


def filtered(made: SmallLog, *, blind: bool = False) -> Array:
    """Computes pose covariances (n, 3, 3) of a Kalman filter along `made` with grown noises; `blind`: no sightings."""
    log, place = made.log, dict(zip(made.map.ids.tolist(), made.map.xy, strict=True))
    known = log.prior.map
    slots: dict[int, int] = {}  # id -> the place of its x in the state
    times: Counter[int] = Counter()  # how often each was sighted
    cov = log.prior.cov.copy()
    if known is not None:
        n = 2 * len(known.ids)
        slots = {landmark: 3 + 2 * i for i, landmark in enumerate(known.ids.tolist())}
        cov = np.block(
            [[cov, np.zeros((3, n))], [np.zeros((n, 3)), np.zeros((n, n)) if known.cov is None else known.cov]]
        )
    covs: list[Array] = []
    for k, step in enumerate(log):
        if step.odometry is not None:
            by_pose, by_delta = se2.compose_jacobians(made.path[k - 1], step.odometry.delta)
            cov[:3] = by_pose @ cov[:3]
            cov[:, :3] = cov[:, :3] @ by_pose.T
            cov[:3, :3] += by_delta @ step.odometry.cov @ by_delta.T
            length = np.hypot(step.odometry.delta[0], step.odometry.delta[1])
            own = step.odometry.cov[0, 0] + step.odometry.cov[1, 1]
            turned = min(cov[2, 2], 2.0)  # no motion ends further off than 2 d
            cov[[0, 1], [0, 1]] += k * (length * turned) ** 2 + own * turned
            if cov[2, 2] > np.pi**2:  # nor is a heading off by more than pi
                scale = np.pi / np.sqrt(cov[2, 2])
                cov[2], cov[:, 2] = cov[2] * scale, cov[:, 2] * scale
        if blind:
            covs.append(cov[:3, :3].copy())
            continue
        old = np.array([landmark in slots for landmark in step.sightings.ids.tolist()], bool)
        seen, new = _taken(step.sightings, old), _taken(step.sightings, ~old)
        if len(seen.ids):
            times.update(seen.ids.tolist())
            xy, columns = (
                np.array([place[i] for i in seen.ids.tolist()]),
                np.array([slots[i] for i in seen.ids.tolist()]),
            )
            cov = _corrected(cov, made.path[k], xy, columns, seen.cov, np.array([times[i] for i in seen.ids.tolist()]))
        if len(new.ids):
            for landmark in new.ids.tolist():
                slots[landmark] = 3 + 2 * len(slots)
            cov = _grown(cov, made.path[k], new)
        covs.append(cov[:3, :3].copy())
    return np.array(covs)


def _taken(sightings: RangeBearing, which: NDArray[np.bool]) -> RangeBearing:
    return RangeBearing(sightings.ids[which], sightings.z[which], sightings.cov[which])


def _corrected(P: Array, pose: Array, xy: Array, columns: Ints, cov: Array, times: Ints) -> Array:
    """Returns `P` after one joint update by sightings, covariances `cov` (m, 2, 2), of landmarks `xy` (m, 2).

    Their x stand at `columns` (m,) of the state, and it is the `times`-th (m,) sighting of each.
    """
    m = len(xy)
    d = xy - pose[:2]
    r = np.maximum(np.hypot(d[:, 0], d[:, 1]), 1e-12)
    ray = d / r[:, None]
    across = np.stack((-ray[:, 1], ray[:, 0]), axis=1) / r[:, None]
    by_landmark = np.stack((ray, across), axis=1)  # (m, 2, 2)
    H = np.zeros((m, 2, len(P)))
    H[:, :, :2] = -by_landmark
    H[:, 1, 2] = -1.0
    row = np.arange(m)
    for axis in (0, 1):
        H[row, :, columns + axis] = by_landmark[:, :, axis]
    s2 = np.maximum(sum(P[columns + a, columns + a] + P[a, a] - 2 * P[columns + a, a] for a in (0, 1)), 0.0)
    q2 = cov[:, 0, 0] + r * r * cov[:, 1, 1]
    second = (times * s2 + q2) * s2 / r**2  # (m,) m^2
    R = cov + np.stack((second, second / r**2), axis=1)[:, :, None] * np.eye(2)
    flat = H.reshape(2 * m, -1)
    PHt = P @ flat.T
    S = flat @ PHt
    for i in range(m):
        S[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += R[i]
    corrected = P - PHt @ np.linalg.solve(S, PHt.T)
    return (corrected + corrected.T) / 2


def _grown(P: Array, pose: Array, new: RangeBearing) -> Array:
    """Returns `P` with the landmarks of first sightings `new` appended: ArUco EKF SLAM, eqs (18)-(20)."""
    r, angle = new.z[:, 0], pose[2] + new.z[:, 1]
    c, s = np.cos(angle), np.sin(angle)
    by_pose = np.zeros((len(r), 2, 3))
    by_pose[:, 0, 0] = by_pose[:, 1, 1] = 1.0
    by_pose[:, :, 2] = np.stack((-r * s, r * c), axis=1)
    by_z = np.stack((np.stack((c, -r * s), axis=1), np.stack((s, r * c), axis=1)), axis=1)
    J = by_pose.reshape(-1, 3)
    cross = J @ P[:3]
    own = cross[:, :3] @ J.T
    noise = by_z @ new.cov @ by_z.swapaxes(1, 2)
    for i in range(len(r)):
        own[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += noise[i]
    return np.block([[P, cross.T], [cross, own]])


def _holds(landmarks: Map, expected: set[int]) -> None:
    """Raises Failed where a sighted landmark is not on the map: its sightings were ignored."""
    missing = sorted(expected - set(landmarks.ids.tolist()))
    if missing:
        raise Failed(
            f"the final map lacks {len(missing)} of {len(expected)} landmarks sighted, id {missing[0]} for one"
        )


def _is_finite(landmarks: Map, which: str) -> None:
    for name, values in (("xy", landmarks.xy), ("covariance", landmarks.cov)):
        if values is not None and not np.isfinite(values).all():
            raise Failed(f"{which} has a {name} that is not finite")
