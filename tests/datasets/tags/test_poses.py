"""6-DoF poses of tags as files: read by readers of their own, against the truth of a rendered drive, in GTSAM."""

import csv
import json
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from differences import central
from slamduel.bench.detect.folder import Request
from slamduel.bench.detect.markers import MarkerFindings, detect
from slamduel.bench.detect.tag_files import ENDINGS
from slamduel.core.se2 import Array
from slamduel.datasets.tags.poses_csv import COLUMNS
from slamduel.frontend.markers.pipeline import see
from tag_drives import TagDrive, robot_at, seen_from, tag_drive


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The drive's poses in each format."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MarkerFindings, "figures", lambda _: [])
        folder, drive = tmp_path_factory.mktemp("poses"), tag_drive()
        found = {ending: folder / f"poses{ending}" for ending in ENDINGS[:3]}
        for ending, path in found.items():
            request = Request("drive", folder / f"log{ending}", poses=path)
            detect(drive.recording, drive.truth, request, lambda _: None)
    return found


def csv_rows(path: Path) -> list[tuple[dict[str, float], Array, Array]]:
    """Rows with their poses and covariances, by the words of the docs alone."""
    rows = []
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            numbers = {name: float(cell) for name, cell in row.items()}
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_quat([numbers[name] for name in ("qx", "qy", "qz", "qw")]).as_matrix()
            pose[:3, 3] = [numbers[name] for name in "xyz"]
            axes = ("x", "y", "z", "rx", "ry", "rz")
            cov = np.zeros((6, 6))
            for i, a in enumerate(axes):
                for j, b in enumerate(axes[i:], start=i):
                    cov[i, j] = cov[j, i] = numbers[f"c_{a}_{b}"]
            rows.append((numbers, pose, cov))
    return rows


def nees(pose: Array, cov: Array, true: Array) -> float:
    """Of 6 degrees of freedom: the place's error, and the turn about the camera's axes that leads to the true one."""
    turn = Rotation.from_matrix(true[:3, :3] @ pose[:3, :3].T).as_rotvec()
    error = np.concatenate((true[:3, 3] - pose[:3, 3], turn))
    return float(error @ np.linalg.solve(cov, error)) / 6


def judged(drive: TagDrive) -> list[float]:
    found = []
    for frame in drive.recording.frames:
        for one in see(drive.recording, frame).sightings:
            pose = one.pose.copy()
            pose[:3, 3] = one.centre
            found.append(nees(pose, one.cov, seen_from(drive, frame.t, one.id)))
    return found


def test_a_csv_file_has_the_poses_with_errors_as_stated(files: dict[str, Path]) -> None:
    assert files[".csv"].read_text(encoding="utf-8").split("\n")[0] == ",".join(COLUMNS)
    drive = tag_drive()
    rows = csv_rows(files[".csv"])
    found = np.array([nees(pose, cov, seen_from(drive, row["t"], int(row["id"]))) for row, pose, cov in rows])
    assert len(found) > 15
    assert abs(found.mean() - 1) < 4 * np.sqrt(2 / 6 / len(found))  # chi-square with six degrees of freedom each
    steps = {row["frame"]: row["t"] for row, *_ in rows}
    np.testing.assert_allclose([drive.truth.t[int(step)] for step in steps], list(steps.values()), atol=1e-9)


@pytest.mark.slow
def test_the_errors_of_poses_are_as_stated_in_many_drives() -> None:
    found = np.array([one for seed in range(1, 9) for one in judged(tag_drive(seed))])
    assert len(found) > 150
    assert abs(found.mean() - 1) < 0.2


def test_a_robot_log_has_factors_that_gtsam_takes(files: dict[str, Path]) -> None:
    """Covariances are those of the CSV file in GTSAM's tangent, and errors at the true poses are as large as stated."""
    drive = tag_drive()
    mounting = drive.recording.detector.camera.mounting
    content = json.loads(files[".jrl"].read_text(encoding="utf-8"))
    initial = {one["key"]: pose_of(one) for one in content["initialization"]["a"]}
    rows, errors = iter(csv_rows(files[".csv"])), list[float]()
    for entry in content["measurements"]["a"]:
        for one in entry["measurements"]:
            assert one["type"] == "BetweenFactorPose3"
            keys = one["key1"], one["key2"]
            assert {*keys} <= {*initial}
            assert [chr(gtsam.Symbol(key).chr()) for key in keys] == ["a", "l"]
            step, name = (gtsam.Symbol(key).index() for key in keys)
            row, pose, cov = next(rows)
            assert (entry["stamp"], step, name) == (row["frame"], row["frame"], row["id"])
            measured, stated = pose_of(one["measurement"]), np.array(one["covariance"]).reshape(6, 6)
            assert measured.equals(gtsam.Pose3(mounting @ pose), 1e-9)
            by_ours = central(
                lambda d, m=measured, p=pose: m.localCoordinates(gtsam.Pose3(mounting @ moved(p, d))), ZERO
            )
            np.testing.assert_allclose(stated, by_ours @ cov @ by_ours.T, rtol=1e-5, atol=1e-6 * np.trace(cov))
            factor = gtsam.BetweenFactorPose3(*keys, measured, gtsam.noiseModel.Gaussian.Covariance(stated))
            values = gtsam.Values()
            values.insert(keys[0], gtsam.Pose3(robot_at(drive, row["t"])))
            values.insert(keys[1], gtsam.Pose3(drive.tags[name]))
            errors.append(2 * factor.error(values) / 6)
    assert next(rows, None) is None
    assert abs(np.mean(errors) - 1) < 4 * np.sqrt(2 / 6 / len(errors))
    first = content["measurements"]["a"][0]["measurements"][0]
    at_start = initial[first["key1"]].inverse() * initial[first["key2"]]
    assert at_start.equals(pose_of(first["measurement"]), 1e-9)


ZERO = np.zeros(6)


def moved(pose: Array, step: Array) -> Array:
    """The pose with its place moved and then turned about the camera's axes, by `step` (6,)."""
    other = pose.copy()
    other[:3, 3] += step[:3]
    other[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix() @ pose[:3, :3]
    return other


def test_pyfg_has_the_same_factors(files: dict[str, Path]) -> None:
    content = json.loads(files[".jrl"].read_text(encoding="utf-8"))
    factors = [one for entry in content["measurements"]["a"] for one in entry["measurements"]]
    lines = [line.split(" ") for line in files[".pyfg"].read_text(encoding="utf-8").splitlines()]
    assert lines[0][0] == "VERTEX_SE3:QUAT"  # by which the package's reader tells the dimension
    vertices = {words[2] for words in lines if words[0] == "VERTEX_SE3:QUAT"}
    edges = [words for words in lines if words[0] == "EDGE_SE3:QUAT"]
    assert len(edges) == len(factors) == len(lines) - len(vertices)
    for words, factor in zip(edges, factors, strict=True):
        assert {words[2], words[3]} <= vertices
        numbers = [float(word) for word in words[4:]]
        pose = gtsam.Pose3(gtsam.Rot3.Quaternion(numbers[6], *numbers[3:6]), np.array(numbers[:3]))
        assert pose.equals(pose_of(factor["measurement"]), 1e-12)
        cov = np.zeros((6, 6))
        cov[np.triu_indices(6)] = numbers[7:]
        cov += np.triu(cov, 1).T
        turn_first = np.block([[cov[3:, 3:], cov[3:, :3]], [cov[:3, 3:], cov[:3, :3]]])
        np.testing.assert_allclose(turn_first.ravel(), factor["covariance"], rtol=1e-12)
        assert words[3] == f"T{gtsam.Symbol(factor['key2']).index()}"


def pose_of(one: dict[str, Any]) -> gtsam.Pose3:
    """As the package jrl reads it: the quaternion begins with w."""
    return gtsam.Pose3(gtsam.Rot3.Quaternion(*one["rotation"]), np.array(one["translation"]))
