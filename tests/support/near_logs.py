"""Logs of robots that pass over landmarks, or beside them, and pose graphs of very uneven information."""

import numpy as np

from driven import NO_LOOPS, NO_SIGHTINGS
from slamduel.core.factors import Dataset, Log, Map, Odometry, Prior, RangeBearing, RelativePoses, Step, Truth
from slamduel.core.se2 import Array, Ints, between, compose, wrap
from slamduel.datasets.tables.csv_sightings import of_points

RADIUS, REACH, SD = 1.2, 0.5, 0.005  # m; of the way, of the sight, and noise of a sighting's x and y


def near_log(
    seed: int,
    *,
    aside: float = 0.0,
    spacing: float = 0.4,
    steps: int = 250,
    stride: float = 0.04,
    drive: tuple[float, float, float] = (0.003, 0.002, 0.004),
    bearing: float | None = None,
) -> Dataset:
    """A robot that goes round over landmarks, give or take a centimetre, or past them, some way `aside`.

    The noise of its sightings is stated as that of x and y, or with bearings known to `bearing`, rad.
    """
    rng = np.random.default_rng(seed)
    around = np.arange(0, 2 * np.pi, spacing / (RADIUS + aside))
    xy = (RADIUS + aside) * np.column_stack((np.sin(around), -np.cos(around))) + [0.0, RADIUS]
    xy += rng.normal(0.0, 0.0 if aside else 0.01, xy.shape)
    pose, poses, made = np.zeros(3), list[Array](), list[Step]()
    for k in range(steps):
        odometry = None
        if k:
            off = np.hypot(pose[0], pose[1] - RADIUS) - RADIUS
            want = np.arctan2(pose[1] - RADIUS, pose[0]) + np.pi / 2 + np.clip(off, -0.3, 0.3)
            turn = stride / RADIUS + 0.2 * wrap(want - pose[2]) + 0.02 * rng.standard_normal()
            motion = np.array([stride, 0.0, turn])
            pose = compose(pose, motion)
            odometry = Odometry(motion + rng.normal(0.0, drive), np.diag(drive) ** 2)
        poses.append(pose)
        c, s = np.cos(pose[2]), np.sin(pose[2])
        place = (xy - pose[:2]) @ np.array([[c, -s], [s, c]])
        seen = np.flatnonzero(np.hypot(*place.T) < REACH)
        made.append(Step(float(k), odometry, sightings(seen.astype(np.int64), place[seen], rng, bearing), NO_LOOPS))
    log = Log.from_steps("near", Prior(np.zeros(3), 1e-6 * np.eye(3)), made)
    ids = np.unique(log.ids)
    return Dataset(log, Truth(log.t, np.array(poses), Map(ids, xy[ids], None), None, "truth"))


def sightings(ids: Ints, place: Array, rng: np.random.Generator, bearing: float | None) -> RangeBearing:
    """Sightings of landmarks at a `place` (k, 2) in the body frame, with noise."""
    if not len(ids):
        return NO_SIGHTINGS
    point = place + rng.normal(0.0, SD, place.shape)
    z = np.column_stack((np.hypot(*point.T), np.arctan2(point[:, 1], point[:, 0])))
    cov = np.zeros((len(ids), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1] = of_points(z[:, 0], SD) if bearing is None else (SD**2, bearing**2)
    return RangeBearing(ids.astype(np.int64), z, cov)


def uneven_graph(seed: int, kind: str, steps: int = 40) -> Dataset:
    """A pose graph whose information is 1e8 or 1e-4 per m^2 and rad^2, on motions and loop closures.

    Kinds: "one" strong motion among weak ones, with strong loop closures; "weak" motions, strong loop closures;
    "alternating".
    """
    rng = np.random.default_rng(seed)
    pose, poses = np.zeros(3), [np.zeros(3)]
    for _ in range(1, steps):
        pose = compose(pose, np.array([1.0, 0.0, 0.3 + 0.05 * rng.standard_normal()]))
        poses.append(pose)
    strong_one, made = int(rng.integers(1, steps)), [Step(0.0, None, NO_SIGHTINGS, NO_LOOPS)]
    for k in range(1, steps):
        strong = {"one": k == strong_one, "weak": False, "alternating": k % 2 == 0}[kind]
        loops = NO_LOOPS
        if k >= 10 and k % 3 == 0:
            delta, cov = measured(poses[k - 10], poses[k], kind == "weak" or (kind == "alternating" and k % 2), rng)
            loops = RelativePoses(np.array([k - 10]), delta[None], cov[None])
        made.append(Step(float(k), Odometry(*measured(poses[k - 1], poses[k], strong, rng)), NO_SIGHTINGS, loops))
    log = Log.from_steps("uneven", Prior(np.zeros(3), 1e-6 * np.eye(3)), made)
    return Dataset(log, Truth(log.t, np.array(poses), None, None, "truth"))


def measured(one: Array, other: Array, strong: object, rng: np.random.Generator) -> tuple[Array, Array]:
    """A motion with its covariance, strong or weak."""
    return between(one, other) + rng.normal(0.0, 1e-4 if strong else 0.03, 3), np.eye(3) / (1e8 if strong else 1e-4)
