"""Drives small inputs through every compiled function of the package: of backends, front ends, worlds, noise.

Prints the functions that were not entered. Run with NUMBA_BOUNDSCHECK=1, it ends with an IndexError where an index is
beyond an end or below zero. NUMBA_CACHE_DIR and SLAMDUEL_CACHE name empty folders: numba's cache does not tell code
with checks from code without, and a log that is found made enters nothing. `tests/core/kernels/test_bounds.py` does so.
"""

import entered

if __name__ == "__main__":
    entered.note()

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

import depth_clouds as room
import index_checks
import inertial_drives
import slamduel
from beacon_drives import drive as beacons
from dense_delayed import with_loops
from gyro_logs import with_gyro
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.gaussian import compressed
from slamduel.backends.keeping import smoother
from slamduel.backends.locating.locating import begin
from slamduel.backends.smoothing import forest
from slamduel.bench.noise.measured import measured
from slamduel.core.factors import UNKNOWN, Log
from slamduel.core.partial import BEARING, RANGE
from slamduel.datasets.depth.registering import Registration
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.inertial.levels import levels
from slamduel.frontend.inertial.standing import standing
from slamduel.frontend.maps.obstacles import Obstacles
from slamduel.frontend.maps.occupancy import occupancy
from slamduel.frontend.maps.top_view import top_view
from slamduel.frontend.markers import template
from slamduel.frontend.markers._share import RIM
from slamduel.frontend.markers.prior import UNKNOWN_CAMERA

BACKENDS: dict[str, list[dict[str, Any]]] = {
    "bias-ekf": [{"range_share": 0.3, "bearing_share": 0.3, "gate": 0.99}],
    "dead-reckoning": [{}],
    "ekf": [{"gate": 0.99}, {"compress_above": 3}, {"update": "joint"}, {"jacobians": "first-estimates", "poses": 9}],
    "fastslam": [{"particles": 20}, {"particles": 20, "version": 1}],
    "fixed-lag": [{"lag": 2.0, "relinearize_skip": 2}, {"lag": 2.0, "loss": "huber"}, {"lag": 2.0, "loss": "cauchy"}],
    "graph": [{}, {"loss": "geman-mcclure", "gnc": True}, {"loss": "huber", "start": "odometry"}],
    "invariant-ekf": [{}],
    "kf": [{}],
    "smoother": [{"relinearize_skip": 7}, {"loss": "huber", "relinearize_skip": 7}, {"loss": "cauchy"}],
    "ukf": [{}],
}
FEW: dict[str, dict[str, Any]] = {
    "ekf": {"compress_above": 3},
    "fastslam": {"particles": 20},
    "fixed-lag": {"lag": 2.0},
    "invariant-ekf": {},
    "smoother": {},
    "ukf": {},
}
"""Those that associate, with options by which little is kept at hand."""


def drive(name: str, log: Log, **options: Any) -> None:
    """Through a log; the backend is asked for its belief and its map on the way."""
    builder = registry.find(name)
    backend: Any = begin(builder, log.prior, builder.options(**options), np.random.default_rng(0))
    for k, step in enumerate(log):
        backend.step(step)
        if k % 5 == 0:
            backend.belief()
            backend.map()
    backend.finish()


def world(name: str) -> Log:
    """The log of a simulated or rendered world."""
    return slamduel.load(name, 1).log


def random_drives() -> None:
    """Few landmarks and, with the compressed filter's default, more than its threshold; loop closures and none."""
    for seed, (steps, landmarks) in enumerate(((60, 8), (40, 150))):
        rng = np.random.default_rng(seed)
        made = random_log(rng, steps, landmarks, errors=1.5)
        loops = with_loops(rng, made, 0.3, errors=1.5)
        for name, several in BACKENDS.items():
            for options in several:
                drive(name, made.log, **options)
                if registry.find(name).loops:
                    drive(name, loops, **options)


def wide() -> None:
    """Maps so large that they are cut into parts."""
    rng = np.random.default_rng(5)
    drive("graph", with_loops(rng, random_log(rng, 400, 90, width=30.0, radius=3.0), 0.05))


def keeping() -> None:
    """Poses that are marginalised into submaps."""
    smoother.OFTEN, smoother.NEWEST, smoother.VISITS = 50, 10, 1
    for more in ("", ",gps=2,compass=2"):
        drive("smoother", slamduel.load(f"city[landmarks=40,steps=400{more}]", 0).log, keep=8.0)
    for landmarks in (0, 60):
        log = slamduel.load(f"patrol[landmarks={landmarks},loops=3,interval=4,steps=500]", 0).log
        drive("smoother", log, keep=10.0, loss="cauchy")


def parts() -> None:
    """Ranges or bearings alone, constant errors, positions and headings."""
    ways: list[dict[str, Any]] = [{"scale_sd": 0.1, "fix_every": 9, "compass": True}, {"kinds": (BEARING, RANGE)}]
    logs = [beacons(1, steps=80, **way).log for way in ways]
    constant = logs[0].prior.systematic._replace(wheel_scale=0.1)
    logs.append(replace(logs[0], prior=logs[0].prior._replace(systematic=constant)))
    for name, several in BACKENDS.items():
        for options, log in product(several, logs):
            if registry.find(name).partial:
                drive(name, log, **options)


def turns() -> None:
    """A gyro's bias in the state."""
    rng = np.random.default_rng(3)
    made, _ = with_gyro(random_log(rng, 60, 8), rng)
    hidden = replace(made.log, ids=np.full(len(made.log.ids), UNKNOWN))
    for name in ("ekf", "fastslam", "invariant-ekf", "ukf"):
        drive(name, hidden, association="jcbb")
    drive("fastslam", hidden, association="particle", particles=20)
    for name, several in BACKENDS.items():
        for options in several:
            if registry.find(name).gyro:
                drive(name, made.log, **options)


def association() -> None:
    """Sightings without ids or with some, clutter, wrong ids, landmarks that move."""
    hidden = world("circle[steps=80,landmarks=16,sighting=0.05,odometry=0.02,clutter=0.1,ids=hidden]")
    moving = world("circle[steps=160,landmarks=16,moving=0.4,wrong_ids=0.05]")
    large, on_map = world("city[landmarks=200,steps=60,ids=hidden]"), world("city[landmarks=60,steps=30,map=surveyed]")
    for rule in ("nn", "ml", "jcbb"):
        drive("ekf", hidden, association=rule, lookahead=2, confirm=2, retire=20)
    drive("ekf", world("circle[steps=350,ids=hidden]"), association="jcbb", confirm=2, merge=True)
    drive("fastslam", world("circle[steps=80,ids=0.5]"), association="particle", particles=20)
    for name, options in FEW.items():
        for log in (hidden, large):
            drive(name, log, association="jcbb", **options)
        for log in (moving, on_map):
            drive(name, log, moved="out", **options)


def maps() -> None:
    """Robots that start anywhere on a map or are carried elsewhere; grids and views by laser and depth camera."""
    lost = world("bailey[loops=1,map=surveyed,start=unknown,kidnap=60,ids=hidden]")
    drive("ekf", lost, association="nn")
    drive("mcl", lost, particles=200)
    clouds = room.room_clouds()
    assert occupancy(Obstacles(clouds), room.PATH).states.any()
    top_view(clouds, room.PATH)
    depth, _ = room.seen(room.PATH[0])
    for lens in ("pinhole", "fisheye"):
        Registration(room.CAMERA, CAMERAS[lens], np.eye(4)).registered(depth)


def front_ends() -> None:
    """Short drives with a laser scanner, a depth camera and cameras that see markers."""
    for name in (
        "laser-floor[laps=1.1,people=1]",
        "depth-room[laps=0.1]",
        "depth-room[laps=0.1,odometry=visual,landmarks=false,loops=true,readout=0.02,mover=0.4]",
        "aruco-room[seconds=2,sensor=phone,ink=0.01,curl=0.002]",
        "aruco-room[seconds=2,building=true,people=2,frame_rate=1,scan_rate=2]",
        "aruco-room[seconds=2,noise=propagated,boxes=2,camera=fisheye,outliers=0.2,shadow=0.5,occlusion=0.3]",
    ):
        world(name)
    assert noisy_marker() is not None


def noisy_marker() -> template.PatternFit | None:
    """A marker whose picture is so grainy that its worst module is looked at."""
    rng = np.random.default_rng(0)
    pattern = np.pad(np.pad(rng.integers(0, 2, (4, 4)).astype(float), 1), RIM, constant_values=1.0)
    grey = np.kron(40 + 160 * pattern, np.ones((12, 12)))
    image = np.clip(grey + rng.normal(0, 20, grey.shape), 0, 255).astype(np.uint8)
    h, w = image.shape
    rays = np.stack(np.meshgrid((np.arange(w) - w / 2) / 300, (np.arange(h) - h / 2) / 300), axis=-1)
    low, high = 12.0 * RIM - 0.5, 12.0 * (len(pattern) - RIM) - 0.5
    corners = np.array([[low, low], [high, low], [high, high], [low, high]])
    return template.fit(image, rays, pattern, (corners - (w / 2, h / 2)) / 300, corners, UNKNOWN_CAMERA)


def hills() -> None:
    """Levels by gravity of a drive over hills, without and with the wheels' speed."""
    one = inertial_drives.drive(seconds=20.0)
    for speed in (None, one.speed):
        levels(one.imu, standing(one.imu), speed)


def noise() -> None:
    """Errors that are correlated in time, stated in two ways and measured."""
    for stated in ("even", "thinned"):
        measured([slamduel.load(f"circle[steps=300,correlated=0.5,stated={stated}]", 0)], ["drawn"])


if __name__ == "__main__":
    index_checks.begin()
    forest.WIDE = 0  # scalars of a front from which dissection is tried
    compressed.MOST, compressed.KEPT = 15, 4  # a part so small that it is settled with the rest every few steps
    Settings.by_words = 2  # loop search by words from the third place on
    for part in (random_drives, wide, keeping, parts, turns, association, maps, front_ends, hills, noise):
        part()
    print(*entered.never(), sep="\n")
