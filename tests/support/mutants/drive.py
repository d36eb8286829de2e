"""A drive as tables of odometry, detections and ground truth."""

import numpy as np

from slamduel.core.se2 import Array, compose, wrap

TABLES = {"odometry": "t,x,y,heading", "detections": "t,id,range,bearing", "truth": "t,x,y,heading"}
"""Columns by table."""

Tables = dict[str, Array]


def drive(rng: np.random.Generator, seconds: float = 60.0) -> Tables:
    """A robot drives a rounded path among 15 landmarks, with the default noise of CSV logs."""
    t = np.arange(0, seconds, 0.1)
    speed, turning = 0.6 + 0.2 * np.sin(t / 7), 0.25 + 0.35 * np.sin(t / 9)
    motions = np.column_stack((speed * 0.1, 0 * t, turning * 0.1))
    way, turn = np.abs(motions[:, 0]), np.abs(motions[:, 2])
    wrong = motions.copy()
    wrong[:, 0] += rng.normal(0, 0.05, len(t)) * np.sqrt(way)
    wrong[:, 2] += rng.normal(0, 1, len(t)) * np.sqrt(0.03**2 * way + 0.05**2 * turn)
    truth, odometry = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for k in range(1, len(t)):
        truth[k], odometry[k] = compose(truth[k - 1], motions[k]), compose(odometry[k - 1], wrong[k])
    places = truth[rng.integers(len(t), size=15), :2] + rng.normal(0, 2.0, (15, 2))
    seen: list[Array] = []
    for k in range(0, len(t), 5):
        x, y = (places - truth[k, :2]).T
        distance, bearing = np.hypot(x, y), wrap(np.arctan2(y, x) - truth[k, 2])
        near = np.flatnonzero((distance < 6) & (distance > 0.5) & (np.abs(bearing) < 1.2))
        z = distance[near] + rng.normal(0, 0.1, len(near)), wrap(bearing[near] + rng.normal(0, 0.02, len(near)))
        seen.append(np.column_stack((np.full(len(near), t[k]), near.astype(np.float64), *z)))
    return {
        "odometry": np.column_stack((t, odometry)),
        "detections": np.concatenate(seen),
        "truth": np.column_stack((t, truth)),
    }
