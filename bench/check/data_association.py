"""Checks of a backend that does data association."""

import dataclasses
from typing import Any

import numpy as np

from ...backends.api import UNKNOWN, Expects
from ...backends.association.layer import Associating
from ...core.factors import Log
from ...core.se2 import Array
from .answers import check_array, check_map
from .candidate import Candidate, Failed, NotApplicable, same
from .small_logs import IDS, RING, a_round, around, drive

GATE = 18.42  # squared distance that a right pair exceeds once in 10,000 times, as data association asks by default


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
        check_array(belief.assigned, (len(step.sightings.ids),), np.int64, f"the belief's assigned at step {k}")
        taken = belief.assigned[belief.assigned != UNKNOWN]
        if len(np.unique(taken)) < len(taken):
            raise Failed(f"it has taken two sightings of step {k} for one landmark: {belief.assigned.tolist()}")
    solution = backend.finish()
    landmarks = backend.map() if solution is None else solution.map
    check_map(landmarks, "the final map")
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


CHECKS = (unknown_landmarks_are_told_apart, asking_what_is_expected_changes_nothing)
