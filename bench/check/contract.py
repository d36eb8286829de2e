"""Checks the return values of a backend's four methods."""

import dataclasses

import numpy as np

from ...backends.api import Backend, Belief, Solution
from ...core import se2
from ...core.factors import Log
from ..measure.answers import is_convergence
from ..words.numerals import counted
from .answers import check_array, check_map
from .candidate import Candidate, Failed, NotApplicable, Trial, first
from .small_logs import NO_SIGHTINGS, a_round, around, drive, with_loops

BLIND = "makes no use of sightings"


def options_are_described(candidate: Candidate) -> str:
    """Its options are a frozen dataclass of option(...) fields, and its maker says in a line what it is."""
    options = candidate.builder.options
    if not dataclasses.is_dataclass(options) or not options.__dataclass_params__.frozen:  # pyright: ignore  # ty: ignore[missing-attribute]
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
            check_array(pose, (3,), np.float64, f"the pose returned at step {k}")
        if belief is None and pose is None:
            continue
        if not isinstance(belief, Belief):
            raise Failed(f"belief() returned a {type(belief).__name__} at step {k}, expected a Belief")
        check_array(belief.pose, (3,), np.float64, f"the belief's pose at step {k}")
        if belief.cov is not None:
            check_array(belief.cov, (3, 3), np.float64, f"the belief's covariance at step {k}")
        if belief.assigned is not None:
            check_array(belief.assigned, (len(log[k].sightings.ids),), np.int64, f"the belief's assigned at step {k}")
        if pose is not None and np.abs(se2.between(pose, belief.pose)).max() > 1e-9:
            raise Failed(f"step {k} returned {pose}, but belief() then says {belief.pose}: expected the same pose")
    check_map(trial.map, "map()")
    if trial.solution is None:
        finished = "None"
    else:
        finished = f"a Solution of {len(log)} poses"
        _check_solution(trial, len(log))
    online, declared = "online" in trial.paths, candidate.builder.is_online(candidate.options)
    if online != declared:
        raise Failed(f"step returned {'poses' if online else 'None'}, but the Builder says online={declared}")
    return f"{', '.join(trial.paths)} path; finish returned {finished}"


def _check_solution(trial: Trial, steps: int) -> None:
    """Checks the types of a solution, and that it has the map's landmarks."""
    solution = trial.solution
    if not isinstance(solution, Solution):
        raise Failed(f"finish() returned a {type(solution).__name__}, expected a Solution or None")
    check_array(solution.path, (steps, 3), np.float64, "the solution's path")
    check_map(solution.map, "the solution's map")
    if "online" in trial.paths and set(solution.map.ids.tolist()) != set(trial.map.ids.tolist()):
        raise Failed("the solution's map and map() hold different landmarks, expected the same")
    if solution.cov is not None:
        check_array(solution.cov, (steps, 3, 3), np.float64, "the solution's covariances")
    if not is_convergence(solution.converged):
        raise Failed(f"the solution's converged is {solution.converged!r}, expected True, False or None")


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
        check_map(landmarks, which)
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


CHECKS = (
    options_are_described,
    answers_have_their_types,
    headings_are_wrapped,
    covariances_are_covariances,
    innovations_are_counted,
    the_map_holds_what_was_seen,
    sightings_make_a_difference,
)
