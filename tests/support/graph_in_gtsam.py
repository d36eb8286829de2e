"""Reads a g2o file directly into GTSAM's factors, independently of our reader."""

import math
from pathlib import Path
from typing import NamedTuple

import gtsam
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Graph(NamedTuple):
    """The factors, and the VERTEX rows."""

    factors: gtsam.NonlinearFactorGraph
    poses: dict[int, list[float]]
    points: dict[int, list[float]]

    def values(self, path: Array | None = None, places: dict[int, Array] | None = None) -> gtsam.Values:
        """The vertices' initial values, or poses (n, 3) in the order of the ids and points by id."""
        values = gtsam.Values()
        for k, (vertex, pose) in enumerate(sorted(self.poses.items())):
            values.insert(vertex, gtsam.Pose2(*(pose if path is None else path[k])))
        for vertex, point in self.points.items():
            values.insert(vertex, np.array(point if places is None else places[vertex]))
        return values

    def optimised(self, start: gtsam.Values) -> tuple[float, Array, dict[int, Array]]:
        """Half of chi square at the optimum, the poses (n, 3) there and the points."""
        params = gtsam.LevenbergMarquardtParams()
        params.setRelativeErrorTol(1e-14)
        params.setAbsoluteErrorTol(0.0)
        params.setMaxIterations(200)
        best = gtsam.LevenbergMarquardtOptimizer(self.factors, start, params).optimize()
        poses = [best.atPose2(vertex) for vertex in sorted(self.poses)]
        path = np.array([[pose.x(), pose.y(), pose.theta()] for pose in poses])
        return self.factors.error(best), path, {vertex: best.atPoint2(vertex) for vertex in self.points}


def read(path: Path) -> Graph:
    """Reads the graph in `path`; an unknown row is an error."""
    graph = Graph(gtsam.NonlinearFactorGraph(), {}, {})
    for line in path.read_text().splitlines():
        tag, *words = line.split()
        numbers = [float(word) for word in words[1:]] if tag != "#" else []
        if tag == "VERTEX_SE2":
            graph.poses[int(words[0])] = numbers
        elif tag == "VERTEX_XY":
            graph.points[int(words[0])] = numbers
        elif tag == "EDGE_PRIOR_SE2":
            model = gtsam.noiseModel.Gaussian.Information(square(numbers[3:]))
            graph.factors.add(gtsam.PriorFactorPose2(int(words[0]), gtsam.Pose2(*numbers[:3]), model))
        elif tag == "EDGE_SE2":
            model = gtsam.noiseModel.Gaussian.Information(square(numbers[4:]))
            ends = int(words[0]), int(words[1])
            graph.factors.add(gtsam.BetweenFactorPose2(*ends, gtsam.Pose2(*numbers[1:4]), model))
        elif tag == "EDGE_SE2_XY":
            x, y = numbers[1:3]
            r = math.hypot(x, y)
            J = np.array([[-y / r**2, x / r**2], [x / r, y / r]])  # of (bearing, range)
            model = gtsam.noiseModel.Gaussian.Covariance(J @ np.linalg.inv(square(numbers[3:])) @ J.T)
            ends = int(words[0]), int(words[1])
            graph.factors.add(gtsam.BearingRangeFactor2D(*ends, gtsam.Rot2(math.atan2(y, x)), r, model))
        elif tag == "FIX":
            for vertex in map(int, words):
                model = gtsam.noiseModel.Isotropic.Sigma(2, 1e-6)
                graph.factors.add(gtsam.PriorFactorPoint2(vertex, np.array(graph.points[vertex]), model))
        else:
            assert tag == "#", line
    return graph


def square(triangle: list[float]) -> Array:
    k = {3: 2, 6: 3}[len(triangle)]
    upper = np.zeros((k, k))
    upper[np.triu_indices(k)] = triangle
    return upper + np.triu(upper, 1).T
