"""A simulated patrol: a robot drives the same round through a building, for days.

It comes back to every place over and over: the log for measuring what a backend costs after a day, where the map no
longer grows. A log of 10^6 steps is made block by block, in time and memory that are linear in its steps.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.arrays import read_only
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array, Ints
from ..false_loops import FalseLoops
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from ..worlds.faults import Faults, with_faults
from ..worlds.floor_plan import Plan, floor_plan
from ..worlds.measurements import odometry, prior, sightings
from .closures import closed
from .furniture import rearranged
from .in_view import landmarks, sighted, view
from .people import MEETING, UNNAMED, with_people
from .rounds import WANDERING, Drive, Rounds, driven, rounds

SIZE, DEPTH = (36.0, 22.0), 5.0  # m: the floor, and the rooms outside of the corridor


@dataclass(frozen=True)
class Options(FalseLoops, HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The rounds, what is seen on them, its noise, and faults."""

    steps: int = option(2000, "steps of the drive", minimum=2, maximum=1_000_000)
    interval: float = option(1.0, "time from step to step, s", minimum=0.05, maximum=10.0)
    speed: float = option(0.5, "speed of the robot, m/s", minimum=0.05, maximum=2.0)
    landmarks: int = option(120, "landmarks on walls; 0: none, for loops alone", minimum=0, maximum=2000)
    reach: float = option(4.0, "range of the sightings, m", minimum=2.5, maximum=30.0)
    loops: int = option(
        0, "a loop closure to an earlier round at every so many steps; 0: none", minimum=0, maximum=1_000_000
    )
    loop_sd: float = option(
        0.05, "noise of a loop closure in x and in y, m", minimum=1e-4, maximum=10.0, beside="loops"
    )
    loop_turn: float = option(0.01, "likewise of its turn, rad", minimum=1e-5, maximum=1.0, beside="loops")
    furniture: float = option(
        0.0, "share of the landmarks that are on furniture, which is moved once a day", minimum=0.0, maximum=1.0
    )
    day: int = option(300, "rounds of a day", minimum=1, maximum=1_000_000, beside="furniture")
    furniture_moves: float = option(
        1.0, "how far furniture is moved in x and in y, at most, m", minimum=0.01, maximum=10.0, beside="furniture"
    )
    people: int = option(0, "people in the corridor who are taken for landmarks", minimum=0, maximum=30)
    people_ids: str = option(
        UNNAMED,
        "ids of their sightings: unknown, or a new one whenever somebody comes into view",
        choices=(UNNAMED, MEETING),
        beside="people",
    )
    forward: float = option(0.02, "noise of the distance of a step, m", minimum=1e-4, maximum=1.0)
    turning: float = option(0.001, "noise of the turn of a step, rad", minimum=1e-5, maximum=1.0)
    sighting: float = option(0.05, "noise of a sighting along and across its line, m", minimum=1e-4, maximum=10)


def patrol(options: Options, rng: np.random.Generator) -> Dataset:
    """The same round through a building, for days, past landmarks or closing loops; one building per seed."""
    _check(options)
    building, driving, moving, seeing, starting, furnishing, walking, closing, failing = rng.spawn(9)
    plan = floor_plan(*SIZE, DEPTH, building)
    path = rounds(plan, options.speed, building)
    xy = landmarks(plan, path, options.landmarks, options.reach, building)
    t = options.interval * np.arange(options.steps, dtype=np.float64)
    drive = driven(path, t, driving)
    delta, delta_cov = odometry(drive.poses, drive.rolled, np.array([options.forward, options.turning]), moving)
    step, ids, z, z_cov = _seen(plan, path, drive, xy, options, seeing)
    counts = {"rounds": int(drive.round[-1]) + 1, "steps of a round": round(path.period / options.interval)}
    notes = {"source": "slamduel's own patrol", **counts, "landmarks sighted": len(np.unique(ids))}
    log = Log.from_arrays(
        "patrol", prior(drive.poses[0], starting), t, delta, delta_cov, step, ids, z, z_cov, notes=notes
    )
    known = Map(np.arange(len(xy)), xy, None)
    log, truth = with_faults(Dataset(log, Truth(t, drive.poses, known, None, "truth")), options, failing)
    assert truth is not None
    if options.furniture:
        day = drive.round // options.day
        log, truth = rearranged(log, truth, options.furniture, day, options.furniture_moves, options.reach, furnishing)
    if options.people:
        log, truth, seen = with_people(
            log, truth, plan, options.people, options.people_ids, options.reach, options.sighting, walking
        )
        log = replace(log, notes={**log.notes, "sightings of people": seen})
    if options.loops:
        log = closed(log, truth, path, drive, options.loops, (options.loop_sd, options.loop_turn), closing)
    return Dataset(log, truth)


def _check(options: Options) -> None:
    """Raises InputError for options that contradict each other."""
    if options.moving and options.furniture:
        raise InputError(
            f"dataset patrol: option moving={options.moving:g}: expected none beside furniture={options.furniture:g}, "
            "whose landmarks are moved once a day."
        )
    beside = [name for name in ("furniture", "people", "loops") if getattr(options, name)]
    if options.kidnap and beside:
        raise InputError(
            f"dataset patrol: option kidnap={options.kidnap:g}: expected 0 beside {' and '.join(beside)}: a robot that "
            "is put elsewhere is no longer on its round."
        )


def _seen(
    plan: Plan, path: Rounds, drive: Drive, xy: Array, options: Options, rng: np.random.Generator
) -> tuple[Ints, Ints, Array, Array]:
    """Steps (s,), ids (s,), sightings (s, 2) and covariances (s, 2, 2)."""
    around = view(plan, path, xy, options.reach + 2 * WANDERING)
    blocks = [
        (step, row, *sightings(drive.poses[step], xy[row], options.sighting, rng))
        for step, row in sighted(drive, around, xy, options.reach)
    ]
    columns = [list(column) for column in zip(*blocks, strict=True)]
    del blocks
    joined: list[Any] = [read_only(np.concatenate(columns.pop(0))) for _ in range(4)]  # each is freed once it is joined
    step, ids, z, cov = joined
    return step, ids, z, cov


source = Source(patrol, options=Options, seeded=True)
