"""Checks that a backend has no side effects: on its path when asked, on its answers, on the log or on another one."""

import dataclasses
import random

import numpy as np

from ...core.se2 import Array
from .candidate import Candidate, Failed, same
from .small_logs import RING, a_round, around, drive


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


CHECKS = (
    the_same_seed_gives_the_same_path,
    chance_comes_from_its_generator,
    asking_changes_nothing,
    answers_stay_as_given,
    the_log_is_left_alone,
    two_at_once_share_nothing,
)
