"""Checks a backend's estimates on logs where any sound estimator ends near the truth.

On exact logs, whose noise is a thousandth of the usual, the bounds are those of `Candidate.slack`; on noisy ones they
are six standard deviations of dead reckoning, which every use of a sighting can only reduce.
"""

import numpy as np

from ...core.factors import Log, Map
from ...core.se2 import Array
from ..words.numerals import counted
from .candidate import ROUNDING, Candidate, Failed, NotApplicable, same, spread, stays_near
from .small_logs import INDOORS, SmallLog, around, behind, dead_reckoned, drive, with_loop, with_loops, with_map

TINY = 1e-3  # noise of exact logs, in units of the usual: filters may differ in its second order
BIAS = np.array([0.01, 0.0, 0.008])  # of odometry, within its stated noise, adds up to a turn of 0.4 rad in 50 steps


def it_starts_at_the_prior(candidate: Candidate) -> str:
    """At step 0 it is at the prior's pose, and moves on from there."""
    start = np.array([3.0, -2.0, 2.5])
    log = drive(np.random.default_rng(11), around(5), start=start, scale=TINY, reach=0.0).log
    position, heading = candidate.slack(log)
    for which, path in candidate.run(log).paths.items():
        stays_near(path[:1], start[None], (position[:1], heading[:1]), f"the {which} start")
    return "it starts at (3, -2), heading 2.5"


def without_sightings_it_is_dead_reckoning(candidate: Candidate) -> str:
    """With odometry alone, the path is the motions one after another."""
    log = drive(np.random.default_rng(12), around(120), scale=TINY, reach=0.0).log
    expected, _ = dead_reckoned(log)
    furthest = _stays_exact(candidate, log, expected)
    return f"at most {furthest:.2g} m from the motions' sum in {len(log)} steps"


def an_exact_log_is_followed(candidate: Candidate) -> str:
    """With exact odometry and sightings, the path is exact."""
    log, truth, _ = drive(np.random.default_rng(13), around(120), scale=TINY, errors=0.0)
    furthest = _stays_exact(candidate, log, truth)
    return f"at most {furthest:.2g} m from the truth in {len(log)} steps"


def landmarks_are_where_they_are(candidate: Candidate) -> str:
    """On an exact log the map is exact, also for a landmark that was seen only once."""
    exact = drive(np.random.default_rng(14), around(60), scale=TINY, errors=0.0, sees=lambda k, i: i != 2 or k == 3)
    trial = candidate.with_landmarks(exact.log)
    if candidate.associates:
        raise NotApplicable("it numbers landmarks by itself")
    position, heading = candidate.slack(exact.log)
    # A landmark is as far off as the pose it was seen from, and the reach of a sighting times its heading.
    bound = position.max() + INDOORS * heading.max()
    off = _map_errors(exact, trial.final_map)
    worst = max(off, key=lambda landmark: off[landmark])
    if not off[worst] <= bound:
        raise Failed(f"landmark {worst} is {off[worst]:.3g} m off, expected at most {bound:.2g} m")
    return f"{counted(len(off), 'landmark')}, at most {off[worst]:.2g} m off"


def it_goes_on_without_sightings(candidate: Candidate) -> str:
    """Long stretches without sightings, after some and before more, do not make it diverge."""
    noisy = drive(np.random.default_rng(15), around(160), sees=lambda k, _: k < 40 or k > 130)
    return f"at most {_stays_within_dead_reckoning(candidate, noisy):.2g} m off with 90 steps without sightings"


def standing_still_does_no_harm(candidate: Candidate) -> str:
    """A robot that stands for 200 steps and looks at the same landmarks stays where it is."""
    rest, start = np.zeros((199, 3)), np.array([1.0, 2.0, 3.0])
    exact = drive(np.random.default_rng(16), rest, start=start, scale=TINY, errors=0.0)  # wheels at rest report zeros
    _stays_exact(candidate, exact.log, exact.path)
    still = drive(np.random.default_rng(16), rest, start=start)
    return f"at most {_stays_within_dead_reckoning(candidate, still):.2g} m off"


def a_landmark_straight_behind_is_no_trouble(candidate: Candidate) -> str:
    """A landmark at a bearing of exactly pi, step after step, is used as any other."""
    exact = behind(np.random.default_rng(17), 0.0, scale=TINY, errors=0.0)
    return f"at most {_stays_exact(candidate, exact.log, exact.path):.2g} m off"


def innovations_are_wrapped(candidate: Candidate) -> str:
    """A landmark behind, whose bearings fall on both sides of the cut at pi, does not disturb the estimate."""
    noisy = behind(np.random.default_rng(18), np.pi)
    return f"at most {_stays_within_dead_reckoning(candidate, noisy):.2g} m off"


def a_given_map_is_used(candidate: Candidate) -> str:
    """On a given exact map, biased odometry does not mislead it, and the map stays as it was given."""
    drifting = _drifting(np.random.default_rng(19))
    given = with_map(drifting, None, np.random.default_rng(20))
    landmarks, found = _localises(candidate, given)
    moved = max(_map_errors(given, landmarks).values())
    if moved > 1e-9:
        raise Failed(f"a landmark of the given map was moved by {moved:.3g} m, expected it held fixed")
    return found


def an_uncertain_map_is_used(candidate: Candidate) -> str:
    """On a given map with a joint covariance, biased odometry does not mislead it."""
    drifting = _drifting(np.random.default_rng(21))
    n = 2 * len(drifting.map.ids)
    common = np.kron(np.ones((n // 2, n // 2)), np.eye(2))  # the map as a whole is shifted, too
    given = with_map(drifting, 0.03**2 * np.eye(n) + 0.02**2 * common, np.random.default_rng(22))
    landmarks, found = _localises(candidate, given)
    _map_errors(given, landmarks)
    return found


def it_is_no_worse_than_dead_reckoning(candidate: Candidate) -> str:
    """On a log of 200 steps with noise as stated, its error is at most one and a half times that of odometry alone."""
    log, truth, _ = drive(np.random.default_rng(23), around(200))
    path, cov = dead_reckoned(log)
    # What dead reckoning is expected to be off counts as well: it may have been lucky.
    plain = max(_rmse(path, truth), float(np.sqrt(np.trace(cov[:, :2, :2].mean(axis=0)))))
    own = {which: _rmse(path, truth) for which, path in candidate.run(log).paths.items()}
    for which, error in own.items():
        if error > 1.5 * plain:
            raise Failed(f"the {which} path is {error:.3g} m off (RMSE), dead reckoning {plain:.3g} m")
    return f"{', '.join(f'{which} {error:.2g} m' for which, error in own.items())}; dead reckoning {plain:.2g} m"


def loop_closures_are_used(candidate: Candidate) -> str:
    """A builder that says loops=True takes a loop closure, and ends where that says."""
    if not candidate.builder.loops:
        raise NotApplicable("a log with loop closures is skipped for it")
    log, truth, _ = with_loop(drive(np.random.default_rng(24), around(85), errors=0.0, bias=BIAS), 0)
    plain, _ = dead_reckoned(log)
    drift = float(np.hypot(*(plain - truth)[-1, :2]))
    for which, path in candidate.run(log).paths.items():
        off = float(np.hypot(*(path - truth)[-1, :2]))
        if off > drift / 2:
            raise Failed(f"the {which} path ends {off:.3g} m off, expected less than half of odometry's {drift:.3g} m")
    return f"dead reckoning ends {drift:.2g} m off, the paths less than half of that"


def loop_closures_and_sightings_go_together(candidate: Candidate) -> str:
    """On an exact log with both, the path is exact, covariances are covariances, and asking changes nothing."""
    if not candidate.builder.loops:
        raise NotApplicable("a log with loop closures is skipped for it")
    rng = np.random.default_rng(25)
    log, truth, _ = with_loops(drive(rng, around(100), scale=TINY, errors=0.0), rng, errors=0.0, scale=TINY)
    furthest = _stays_exact(candidate, log, truth)
    asked = candidate.run(log, asking=True)
    same(asked.paths, candidate.run(log).paths, "a run asked for beliefs and one that was not")
    covs = [belief.cov for belief in asked.beliefs if belief and belief.cov is not None]
    if asked.solution is not None:
        covs += [] if asked.solution.cov is None else list(asked.solution.cov)
        covs += [] if asked.solution.map.cov is None else [asked.solution.map.cov]
    for cov in covs:
        least = np.linalg.eigvalsh(cov)[0] if np.isfinite(cov).all() else np.nan
        # The sample covariance of a few particles may have lost a direction.
        if not least > (-1e-12 * np.abs(cov).max() if candidate.builder.random else 0):
            raise Failed(f"a covariance has the eigenvalue {least:.3g}, expected them positive")
    return f"at most {furthest:.2g} m off with {len(log.loop_to)} loop closures, {len(covs)} covariances"


def _stays_exact(candidate: Candidate, log: Log, expected: Array) -> float:
    paths = candidate.run(log).paths
    return max(stays_near(path, expected, candidate.slack(log), f"the {which} path") for which, path in paths.items())


def _stays_within_dead_reckoning(candidate: Candidate, noisy: SmallLog) -> float:
    _, cov = dead_reckoned(noisy.log)
    paths = candidate.run(noisy.log).paths
    return max(stays_near(path, noisy.path, spread(cov), f"the {which} path") for which, path in paths.items())


def _drifting(rng: np.random.Generator) -> SmallLog:
    """Makes a log of biased odometry where every landmark is sighted at two steps only: only a map helps."""
    return drive(rng, around(50), bias=BIAS, reach=20.0, sees=lambda k, i: k - (8 + 8 * (i // 2)) in (0, 1))


def _localises(candidate: Candidate, given: SmallLog) -> tuple[Map, str]:
    plain, _ = dead_reckoned(given.log)
    trial = candidate.run(given.log)
    if all(np.abs(path - plain).max() < ROUNDING for path in trial.paths.values()):
        raise NotApplicable("it makes no use of sightings")
    last = slice(-len(plain) // 4, None)
    drift = _rmse(plain[last], given.path[last])
    off = {which: _rmse(path[last], given.path[last]) for which, path in trial.paths.items()}
    for which, error in off.items():
        if error > drift / 2:
            raise Failed(
                f"the {which} path is {error:.3g} m off (RMSE of the last quarter), expected less than half of "
                f"odometry's {drift:.3g} m"
            )
    return trial.final_map, f"{max(off.values()):.2g} m off in the last quarter, odometry {drift:.2g} m"


def _rmse(path: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((path - truth)[:, :2] ** 2, axis=1))))


def _map_errors(made: SmallLog, landmarks: Map) -> dict[int, float]:
    """Each landmark's distance (m) from its true place, or from that on the given map."""
    given = made.map if made.log.prior.map is None else made.log.prior.map
    place = dict(zip(landmarks.ids.tolist(), landmarks.xy, strict=True))
    missing = [landmark for landmark in given.ids.tolist() if landmark not in place]
    if missing:
        raise Failed(f"its map lacks ids {missing}")
    return {i: float(np.hypot(*(place[i] - at))) for i, at in zip(given.ids.tolist(), given.xy, strict=True)}


CHECKS = (
    it_starts_at_the_prior,
    without_sightings_it_is_dead_reckoning,
    an_exact_log_is_followed,
    landmarks_are_where_they_are,
    it_goes_on_without_sightings,
    standing_still_does_no_harm,
    a_landmark_straight_behind_is_no_trouble,
    innovations_are_wrapped,
    a_given_map_is_used,
    an_uncertain_map_is_used,
    it_is_no_worse_than_dead_reckoning,
    loop_closures_are_used,
    loop_closures_and_sightings_go_together,
)
