"""Checks a backend's contract: the return values of its four methods, and the absence of side effects."""

import dataclasses
import random
from typing import Any

import numpy as np

from ...backends.api import UNKNOWN, Backend, Belief, Expects, Map, Solution
from ...backends.association.layer import Associating
from ...frontend import se2
from ...frontend.factors import Log
from ...frontend.se2 import Array
from ..words.numerals import counted
from .candidate import Candidate, Failed, NotApplicable, first, same
from .small_logs import IDS, NO_SIGHTINGS, RING, around, drive, with_loops

BLIND = "makes no use of sightings"

GATE = 18.42  # squared distance that a right pair exceeds once in 10,000 times, as data association asks by default


def a_round() -> Log:
    """Makes a drive of just over one round of the circle, so that landmarks return and the heading crosses pi."""
    return drive(np.random.default_rng(1), around(90)).log


def options_are_described(candidate: Candidate) -> str:
    """Its options are a frozen dataclass of option(...) fields, and its maker says in a line what it is."""
    options = candidate.builder.options
    if not dataclasses.is_dataclass(options) or not options.__dataclass_params__.frozen:  # pyright: ignore
        raise Failed(f"options is {options!r}, expected a frozen dataclass")
    fields = dataclasses.fields(options)
    for field in fields:
        if not field.metadata.get("summary"):
            raise Failed(f"option {field.name} has no summary, expected a field made with option(default, summary)")
    if not candidate.builder.summary:
        raise Failed("the maker has no docstring, expected one whose first line is shown by `bench list`")
    return f"{len(fields)} options, each with a summary"


def answers_have_their_types(candidate: Candidate) -> str:
    """step, belief, map and finish return what the contract says, in shape and type, finite."""
    log = a_round()
    backend = candidate.fresh(log.prior)
    if not isinstance(backend, Backend):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise Failed(f"the maker returned a {type(backend).__name__}, expected one with step, belief, map and finish")
    trial = candidate.run(log, asking=True)
    for k, (pose, belief) in enumerate(zip(trial.returned, trial.beliefs, strict=True)):
        if pose is not None:
            _array(pose, (3,), np.float64, f"the pose returned at step {k}")
        if belief is None and pose is None:
            continue
        if not isinstance(belief, Belief):
            raise Failed(f"belief() returned a {type(belief).__name__} at step {k}, expected a Belief")
        _array(belief.pose, (3,), np.float64, f"the belief's pose at step {k}")
        if belief.cov is not None:
            _array(belief.cov, (3, 3), np.float64, f"the belief's covariance at step {k}")
        if belief.assigned is not None:
            _array(belief.assigned, (len(log[k].sightings.ids),), np.int64, f"the belief's assigned at step {k}")
        if pose is not None and np.abs(se2.between(pose, belief.pose)).max() > 1e-9:
            raise Failed(f"step {k} returned {pose}, but belief() then says {belief.pose}: expected the same pose")
    _map(trial.map, "map()")
    if trial.solution is None:
        return f"{', '.join(trial.paths)} path; finish returned None"
    if not isinstance(trial.solution, Solution):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise Failed(f"finish() returned a {type(trial.solution).__name__}, expected a Solution or None")
    _array(trial.solution.path, (len(log), 3), np.float64, "the solution's path")
    _map(trial.solution.map, "the solution's map")
    if "online" in trial.paths and set(trial.solution.map.ids.tolist()) != set(trial.map.ids.tolist()):
        raise Failed("the solution's map and map() hold different landmarks, expected the same")
    if trial.solution.cov is not None:
        _array(trial.solution.cov, (len(log), 3, 3), np.float64, "the solution's covariances")
    return f"{', '.join(trial.paths)} path; finish returned a Solution of {len(log)} poses"


def headings_are_wrapped(candidate: Candidate) -> str:
    """Every heading it gives is in (-pi, pi], also after two rounds."""
    trial = candidate.run(drive(np.random.default_rng(2), around(180)).log, asking=True)
    paths = trial.paths | {"believed": np.array([belief.pose for belief in trial.beliefs if belief]).reshape(-1, 3)}
    for which, path in paths.items():
        outside = (path[:, 2] <= -np.pi) | (path[:, 2] > np.pi)
        if outside.any():
            k = first(outside)
            raise Failed(f"the {which} heading at step {k} is {path[k, 2]:.4f} rad, expected it in (-pi, pi]")
    return "so they are"


def covariances_are_covariances(candidate: Candidate) -> str:
    """Covariances are symmetric and positive definite, or None where they are not known."""
    trial = candidate.run(a_round(), asking=True)
    covs = [(f"the belief at step {k}", belief.cov) for k, belief in enumerate(trial.beliefs) if belief]
    covs.append(("map()", trial.map.cov))
    if trial.solution is not None:
        poses = () if trial.solution.cov is None else trial.solution.cov
        covs += [(f"the solution at step {k}", cov) for k, cov in enumerate(poses)]
        covs.append(("the solution's map", trial.solution.map.cov))
    known = [(which, cov) for which, cov in covs if cov is not None and cov.size]
    for which, cov in known:
        largest = np.abs(cov).max()
        if not np.isfinite(largest):
            raise Failed(f"the covariance of {which} is not finite")
        if np.abs(cov - cov.T).max() > 1e-9 * largest:
            raise Failed(f"the covariance of {which} is not symmetric: {np.abs(cov - cov.T).max():.3g} apart")
        smallest = np.linalg.eigvalsh(cov)[0]
        # The sample covariance of a few particles may have lost a direction.
        if smallest < -1e-12 * largest or (smallest <= 0 and not candidate.builder.random):
            raise Failed(f"the covariance of {which} has the eigenvalue {smallest:.3g}, expected them positive")
    if not known:
        raise NotApplicable("it gives no covariance")
    return f"{len(known)} covariances, all positive definite"


def innovations_are_counted(candidate: Candidate) -> str:
    """A NIS is not negative and has at most two degrees of freedom a sighting, three a loop closure, none without."""
    seeing = drive(np.random.default_rng(3), around(60), sees=lambda k, _: k % 3 > 0)
    log = with_loops(seeing, np.random.default_rng(31)).log if candidate.builder.loops else seeing.log
    trial = candidate.run(log, asking=True)
    beliefs = [(k, belief) for k, belief in enumerate(trial.beliefs) if belief]
    for k, belief in beliefs:
        sightings, loops = len(log[k].sightings.ids), len(log[k].loops.to)
        most = 2 * sightings + 3 * loops
        if not 0 <= belief.nis_dof <= most:
            given = f"{sightings} sightings" + f" and {loops} loop closures" * bool(loops)
            raise Failed(f"nis_dof is {belief.nis_dof} at step {k} with {given}, expected 0 to {most}")
        if belief.nis is not None and not 0 <= belief.nis < np.inf:
            raise Failed(f"nis is {belief.nis} at step {k}, expected a finite number of at least 0, or None")
        if belief.n_eff is not None and not 0 < belief.n_eff < np.inf:
            raise Failed(f"n_eff is {belief.n_eff} at step {k}, expected a finite number above 0, or None")
    if all(belief.nis is None for _, belief in beliefs):
        raise NotApplicable("it gives no NIS")
    return f"{sum(belief.nis_dof for _, belief in beliefs)} degrees of freedom in {len(log)} steps"


def the_map_holds_what_was_seen(candidate: Candidate) -> str:
    """Its map has each landmark that was sighted once, under the id it was sighted with, however large."""
    log = drive(np.random.default_rng(4), around(60)).log
    trial = candidate.with_landmarks(log)
    expected = set(log.ids.tolist())
    maps = {"the final map": trial.final_map}
    if "online" in trial.paths:  # a batch method has no map before it is finished
        maps["map()"] = trial.map
    for which, landmarks in maps.items():
        _map(landmarks, which)
        ids = landmarks.ids.tolist()
        if not candidate.associates and set(ids) != expected:
            missing, extra = sorted(expected - set(ids)), sorted(set(ids) - expected)
            raise Failed(f"{which} lacks ids {missing} and has {extra} that were never sighted")
    return counted(len(trial.final_map.ids), "landmark")


def sightings_make_a_difference(candidate: Candidate) -> str:
    """Its path, its covariances or its map are others where the sightings are taken out of the log."""
    log = a_round()
    blind = Log.from_steps(log.name, log.prior, [step._replace(sightings=NO_SIGHTINGS) for step in log])
    found, without = (candidate.run(one, asking=True) for one in (log, blind))
    if len(found.final_map.ids) > len(without.final_map.ids):
        return f"{counted(len(found.final_map.ids), 'landmark')} in its map"
    if any(not np.array_equal(found.paths[which], without.paths[which]) for which in found.paths):
        return "another path"
    seeing, not_seeing = (
        np.array([belief.cov for belief in trial.beliefs if belief and belief.cov is not None])
        for trial in (found, without)
    )
    if not np.array_equal(seeing, not_seeing):
        return "the same path, other covariances"
    raise NotApplicable(BLIND)


def the_same_seed_gives_the_same_path(candidate: Candidate) -> str:
    """Two runs with one seed give the same path bit for bit."""
    log = a_round()
    same(candidate.run(log, seed=3).paths, candidate.run(log, seed=3).paths, "two runs with the same seed")
    return f"{len(log)} steps are the same bit for bit"


def chance_comes_from_its_generator(candidate: Candidate) -> str:
    """It draws from the generator it is given or, unless it is declared random, from none; never from a global one."""
    log = a_round()
    rng = np.random.default_rng(5)
    before = rng.bit_generator.state
    numpy_before, python_before = str(np.random.get_state()), random.getstate()  # noqa: NPY002  the culprit itself
    backend = candidate.builder.make(log.prior, candidate.options, rng)
    for step in log:
        backend.step(step)
        backend.belief()
    backend.map()
    backend.finish()
    if str(np.random.get_state()) != numpy_before:  # noqa: NPY002
        raise Failed("numpy's global random state has changed, expected it left alone")
    if random.getstate() != python_before:
        raise Failed("the state of Python's random module has changed, expected it left alone")
    drew = rng.bit_generator.state != before
    if drew and not candidate.builder.random:
        raise Failed("it has drawn from rng, expected it not to, or the builder to say random=True")
    return "it drew from the generator it was given" if drew else "it drew nothing"


def asking_changes_nothing(candidate: Candidate) -> str:
    """Asking for belief and map after every step leaves the path as it is, to the last bit."""
    log = a_round()
    asked, alone = candidate.run(log, asking=True), candidate.run(log)
    same(asked.paths, alone.paths, "a run asked for beliefs and one that was not")
    return f"{len(log)} steps are the same bit for bit"


def answers_stay_as_given(candidate: Candidate) -> str:
    """A pose, belief or map that was handed out does not change when the backend moves on."""
    log = a_round()
    backend = candidate.fresh(log.prior)
    given: list[tuple[str, Array, Array]] = []
    for k, step in enumerate(log):
        pose, belief, landmarks = backend.step(step), backend.belief(), backend.map()
        answers = {"pose": pose, "map": landmarks.xy, "map's covariance": landmarks.cov}
        if belief is not None:
            answers |= {"belief's pose": belief.pose, "belief's covariance": belief.cov}
        given += [(f"the {name} of step {k}", a, a.copy()) for name, a in answers.items() if a is not None]
    for which, answer, copy in given:
        if not np.array_equal(answer, copy, equal_nan=True):
            raise Failed(f"{which} was changed later on, expected a copy to be handed out")
    return f"{len(given)} answers stayed"


def the_log_is_left_alone(candidate: Candidate) -> str:
    """The factors and the prior are neither changed nor made writable."""
    log = a_round()
    candidate.run(log, asking=True)
    if dataclasses.replace(log).digest != log.digest or log.digest != a_round().digest:
        raise Failed("the log is no longer what it was before the run")
    columns = {name: value for name, value in vars(log).items() if isinstance(value, np.ndarray)}
    columns |= {"prior.pose": log.prior.pose, "prior.cov": log.prior.cov}
    for name, column in columns.items():
        if column.flags.writeable:
            raise Failed(f"{name} was made writable, expected the log left alone")
    return "its digest is the same"


def two_at_once_share_nothing(candidate: Candidate) -> str:
    """Two instances that take turns give the paths that each gives on its own."""
    here = a_round()
    there = drive(np.random.default_rng(6), around(90), start=np.array([-4.0, 1.0, -2.0]), xy=RING[::-1]).log
    alone = [candidate.run(log).paths for log in (here, there)]
    pair = [candidate.fresh(log.prior) for log in (here, there)]
    taken = [[backend.step(log[k]) for backend, log in zip(pair, (here, there), strict=True)] for k in range(len(here))]
    for i, backend in enumerate(pair):
        online = [poses[i] for poses in taken]
        solution = backend.finish()
        together = {} if online[0] is None else {"online": np.array(online)}
        together |= {} if solution is None else {"final": solution.path}
        same(alone[i], together, "a run alone and one that took turns with another")
    return "both paths are the same bit for bit"


def unknown_landmarks_are_told_apart(candidate: Candidate) -> str:
    """One that does data association finds as many landmarks as there are, and none twice in a step."""
    if not candidate.associates:
        raise NotApplicable("sightings without id are taken out before it sees the log")
    identified = drive(np.random.default_rng(7), around(60), ids=IDS[::3], xy=RING[::3]).log
    log = nameless(identified)
    backend = candidate.fresh(log.prior)
    for k, step in enumerate(log):
        backend.step(step)
        belief = backend.belief()
        if belief is None or belief.assigned is None:
            raise Failed(f"assigned is None at step {k}, expected the landmark each sighting was taken for")
        _array(belief.assigned, (len(step.sightings.ids),), np.int64, f"the belief's assigned at step {k}")
        taken = belief.assigned[belief.assigned != UNKNOWN]
        if len(np.unique(taken)) < len(taken):
            raise Failed(f"it has taken two sightings of step {k} for one landmark: {belief.assigned.tolist()}")
    solution = backend.finish()
    landmarks = backend.map() if solution is None else solution.map
    _map(landmarks, "the final map")
    there = len(set(identified.ids.tolist()))
    if abs(len(landmarks.ids) - there) > 1:
        raise Failed(f"{len(landmarks.ids)} landmarks are in its map, expected {there}, which stand well apart")
    return f"{len(landmarks.ids)} landmarks where there are {there}"


def asking_what_is_expected_changes_nothing(candidate: Candidate) -> str:
    """Asked twice what it expects to see, it gives the same path as asked once, to the last bit."""
    log = a_round()
    paths: list[dict[str, Array]] = []
    for times in (1, 2):
        backend = candidate.fresh(log.prior)
        asked: Any = backend.inner if isinstance(backend, Associating) else backend
        if not isinstance(asked, Expects):
            raise NotApplicable("it does not say what it expects to see: no data association")
        poses = list[Any]()
        for step in log:
            for _ in range(times):
                asked.expected(step.odometry, step.sightings, GATE)
            poses.append(backend.step(step))
        solution = backend.finish()
        online = [pose for pose in poses if pose is not None]
        paths.append(
            ({"online": np.array(online)} if online else {}) | ({} if solution is None else {"final": solution.path})
        )
    same(paths[0], paths[1], "a run asked once a step and one asked twice")
    return f"{len(log)} steps are the same bit for bit"


def nameless(log: Log) -> Log:
    """The log without ids."""
    hidden = np.full(len(log.ids), UNKNOWN)
    return dataclasses.replace(log, ids=hidden)


def _array(value: object, shape: tuple[int, ...], dtype: type, what: str) -> None:
    if not isinstance(value, np.ndarray):
        raise Failed(f"{what} is a {type(value).__name__}, expected an array of shape {shape}")
    if value.shape != shape or value.dtype != dtype:
        raise Failed(f"{what} is {value.dtype} {value.shape}, expected {np.dtype(dtype)} {shape}")
    if not np.isfinite(value).all():
        raise Failed(f"{what} is not finite: {value.tolist()}")


def _map(landmarks: object, what: str) -> None:
    if not isinstance(landmarks, Map):
        raise Failed(f"{what} is a {type(landmarks).__name__}, expected a Map")
    n = len(landmarks.ids)
    _array(landmarks.ids, (n,), np.int64, f"{what}'s ids")
    _array(landmarks.xy, (n, 2), np.float64, f"{what}'s xy")
    if len(np.unique(landmarks.ids)) < n:
        raise Failed(f"{what} has a landmark twice among ids {landmarks.ids.tolist()}, expected each once")
    if landmarks.cov is not None:
        _array(landmarks.cov, (2 * n, 2 * n), np.float64, f"{what}'s covariance")


CHECKS = (
    options_are_described,
    answers_have_their_types,
    headings_are_wrapped,
    covariances_are_covariances,
    innovations_are_counted,
    the_map_holds_what_was_seen,
    sightings_make_a_difference,
    the_same_seed_gives_the_same_path,
    chance_comes_from_its_generator,
    asking_changes_nothing,
    answers_stay_as_given,
    the_log_is_left_alone,
    two_at_once_share_nothing,
    unknown_landmarks_are_told_apart,
    asking_what_is_expected_changes_nothing,
)
