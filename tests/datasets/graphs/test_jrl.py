"""JSON Robot Logs: read as GTSAM means their factors, written and read again, or refused with their place."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

import graph_in_gtsam
import slamduel
from fuzzing import survivors
from graph_round_trip import all_kinds, assert_same_graph, assert_same_parts, with_parts
from refusals import refused, refused_at
from slamduel.bench.plan.spec import dataset_variants
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import Array
from slamduel.core.truth.check import check_truth
from slamduel.datasets.formats.g2o_write import write_g2o
from slamduel.datasets.graphs.jrl import read
from slamduel.datasets.graphs.jrl_write import write_jrl
from small_log import small_log

A, L = ord("a") << 56, ord("l") << 56


def pose(x: float, y: float, theta: float) -> dict[str, Any]:
    return {"type": "Pose2", "x": x, "y": y, "theta": theta}


def between(first: int, last: int, motion: dict[str, Any], sd: float = 0.1) -> dict[str, Any]:
    cov = (sd**2 * np.eye(3)).ravel().tolist()
    return {
        "type": "BetweenFactorPose2", "key1": A + first, "key2": A + last, "measurement": motion, "covariance": cov,
    }  # fmt: skip


def small() -> dict[str, Any]:
    """Three poses, a loop that is false and two sightings, a bearing being an object and a plain number."""
    seen = {"bearing": {"type": "Rot2", "theta": 0.3}, "range": {"type": "Scalar", "value": 2.0}}
    cov = [0.04, 0.01, 0.01, 0.09]  # of bearing and range
    prior = {"type": "PriorFactorPose2", "key": A, "prior": pose(1, 2, 0.5), "covariance": np.eye(3).ravel().tolist()}
    mark = {"type": "BearingRangeFactor2D", "key1": A, "key2": L + 7, "measurement": seen, "covariance": cov}
    second = {**mark, "key1": A + 2, "measurement": {"bearing": -0.1, "range": 1.5}}
    entries = [
        {"stamp": 0, "measurements": [prior, mark]},
        {"stamp": 1, "measurements": [between(0, 1, pose(1, 0, 0.1))]},
        {"stamp": 2, "measurements": [between(1, 2, pose(1, 0, 0.2)), between(0, 2, pose(9, 9, 3)), second]},
    ]
    right = [{"key": A + k, **pose(1 + k, 2, 0.5)} for k in (1, 0, 2)] + [
        {"key": L + 7, "type": "Point2", "x": 3, "y": 4}
    ]
    return {
        "name": "three", "robots": ["a"], "measurements": {"a": entries}, "groundtruth": {"a": right},
        "outlier_factors": {"a": [[2, 1]]},
    }  # fmt: skip


def written(folder: Path, change: Callable[[dict[str, Any]], Any] | None = None) -> Path:
    content = small()
    if change is not None:
        change(content)
    (path := folder / "three.jrl").write_text(json.dumps(content, indent=1))
    return path


def test_each_factor_is_where_it_belongs(tmp_path: Path) -> None:
    log, truth = read(written(tmp_path))
    assert list(problems(log)) == []
    assert truth is not None
    check_truth(log, truth, "three")
    np.testing.assert_array_equal(log.delta[1:], [[1, 0, 0.1], [1, 0, 0.2]])
    np.testing.assert_array_equal(log.prior.pose, [1, 2, 0.5])
    assert (log.loop_step.tolist(), log.loop_to.tolist()) == ([2], [0])
    np.testing.assert_array_equal(log.z, [[2, 0.3], [1.5, -0.1]])  # ours has the range first
    np.testing.assert_array_equal(log.z_cov[0], [[0.09, 0.01], [0.01, 0.04]])
    assert log.ids.tolist() == [7, 7]
    np.testing.assert_array_equal(truth.poses, [[1, 2, 0.5], [2, 2, 0.5], [3, 2, 0.5]])
    assert truth.map is not None
    assert (truth.map.ids.tolist(), truth.map.xy.tolist()) == ([7], [[3, 4]])
    assert truth.false_loops is not None
    assert truth.false_loops.tolist() == [0]


def in_gtsam(path: Path) -> tuple[gtsam.NonlinearFactorGraph, set[int]]:
    """The factors of a log, by GTSAM alone, and the keys of its poses."""
    graph, poses = gtsam.NonlinearFactorGraph(), set[int]()
    for entry in json.loads(path.read_text())["measurements"]["a"]:
        for one in entry["measurements"]:
            k = math.isqrt(len(one["covariance"]))
            model = gtsam.noiseModel.Gaussian.Covariance(np.array(one["covariance"]).reshape(k, k))
            if one["type"] == "PriorFactorPose2":
                at = (one["prior"][name] for name in ("x", "y", "theta"))
                graph.add(gtsam.PriorFactorPose2(one["key"], gtsam.Pose2(*at), model))
                poses.add(one["key"])
            elif one["type"] == "BetweenFactorPose2":
                motion = gtsam.Pose2(*(one["measurement"][name] for name in ("x", "y", "theta")))
                graph.add(gtsam.BetweenFactorPose2(one["key1"], one["key2"], motion, model))
                poses |= {one["key1"], one["key2"]}
            else:
                bearing, far = one["measurement"]["bearing"]["theta"], one["measurement"]["range"]["value"]
                keys = one["key1"], one["key2"]
                graph.add(gtsam.BearingRangeFactor2D(*keys, gtsam.Rot2(bearing), far, model))
    return graph, poses


@pytest.mark.parametrize("seed", range(3))
def test_gtsam_has_the_same_cost_of_it_as_of_the_g2o_file(tmp_path: Path, seed: int) -> None:
    """Anywhere: covariances are in the right frames, and in the right order."""
    dataset = all_kinds(seed)
    assert dataset.truth is not None
    assert dataset.truth.map is not None
    write_jrl(tmp_path / "log.jrl", dataset)
    write_g2o(tmp_path / "log.g2o", dataset.log)
    graph, keys = in_gtsam(tmp_path / "log.jrl")
    other = graph_in_gtsam.read(tmp_path / "log.g2o")
    rng = np.random.default_rng(seed)
    for _ in range(3):
        path = dataset.truth.poses + 0.05 * rng.standard_normal(dataset.truth.poses.shape)
        places: dict[int, Array] = dict(
            zip(dataset.truth.map.ids.tolist(), dataset.truth.map.xy + 0.05 * rng.standard_normal((20, 2)), strict=True)
        )
        values = gtsam.Values()
        for key, at in zip(sorted(keys), path, strict=True):
            values.insert(key, gtsam.Pose2(*at))
        for name in np.unique(dataset.log.ids).tolist():
            values.insert(L + name, places[name])
        assert graph.error(values) == pytest.approx(other.factors.error(other.values(path, places)), rel=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_a_log_comes_back_with_factors_truth_and_false_loops(tmp_path: Path, seed: int) -> None:
    dataset = all_kinds(seed)
    assert write_jrl(tmp_path / "log.jrl", dataset) == 0
    (variant,) = dataset_variants(str(tmp_path / "log.jrl"))
    assert variant.name == "jrl"
    found = read(tmp_path / "log.jrl")
    assert_same_graph(found, dataset, times=False)
    assert found.truth is not None
    assert dataset.truth is not None
    np.testing.assert_array_equal(found.truth.false_loops, dataset.truth.false_loops)


def test_ranges_alone_and_priors_of_other_poses_come_back(tmp_path: Path) -> None:
    dataset = with_parts(all_kinds(0), RANGE)
    assert write_jrl(tmp_path / "log.jrl", dataset) == 1
    found = read(tmp_path / "log.jrl")
    assert_same_graph(found, dataset, times=False)
    assert_same_parts(found.log, dataset.log)
    bearings = with_parts(all_kinds(0), BEARING)
    refused("has bearings alone, which a JSON Robot Log cannot", write_jrl, tmp_path / "x.jrl", bearings)


def test_a_range_may_be_a_plain_number(tmp_path: Path) -> None:
    log, _ = read(written(tmp_path, ranges))
    assert log.partial is not None
    assert [column.tolist() for column in log.partial.columns.values()] == [[0, 0, 1, 1], [5], [RANGE], [2.0], [0.1]]


def test_unknown_sightings_and_a_missing_truth_are_left_out(tmp_path: Path) -> None:
    def change(parts: dict[str, Any]) -> None:
        parts["prior"] = parts["prior"]._replace(map=None)

    log = small_log(3, change)
    assert write_jrl(tmp_path / "log.jrl", Dataset(log, None)) == 2
    found, truth = read(tmp_path / "log.jrl")
    assert truth is None
    assert_same_graph(Dataset(found, None), Dataset(log.identified(), None), times=False)
    refused("has a given map", write_jrl, tmp_path / "x.jrl", Dataset(small_log(3), None))


def first(content: dict[str, Any]) -> dict[str, Any]:
    return content["measurements"]["a"][1]["measurements"][0]


def ranges(content: dict[str, Any]) -> dict[str, Any]:
    """A range alone that is added to the content."""
    found = {"type": "RangeFactor2D", "key1": A + 1, "key2": L + 5, "measurement": 2.0, "covariance": [0.1]}
    content["measurements"]["a"][1]["measurements"].append(found)
    return found


FAULTS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "3D": (lambda c: first(c).update(type="BetweenFactorPose3"),
        "entry 1, measurement 0: found a 'BetweenFactorPose3', in space"),
    "a range": (lambda c: first(c).update(type="RangeFactorPose2"),
        "entry 1, measurement 0: found a 'RangeFactorPose2', a range between poses"),
    "a range without a number": (lambda c: ranges(c).update(measurement={"value": "far"}), "range is 'far', expected"),
    "a range below zero": (lambda c: ranges(c).update(measurement={"type": "Scalar", "value": -2}),
        "entry 1, measurement 1: range is -2.0, expected more than 0"),
    "a range without noise": (lambda c: ranges(c).update(covariance=[0]), "measurement 1: crr is 0.0, expected a var"),
    "a mark's prior": (lambda c: first(c).update(type="PriorFactorPoint2"), "a prior of a landmark"),
    "another robot": (lambda c: c["measurements"].update(b=[{"stamp": 0}]), "found measurements of 2 robots"),
    "its key": (lambda c: first(c).update(key2=(ord("b") << 56) + 1), "entry 1, measurement 0: found the letter 'b'"),
    "no key": (lambda c: first(c).pop("key2"), "entry 1, measurement 0: found the key 'None'"),
    "a word": (lambda c: first(c)["measurement"].update(x="one"),
        "entry 1, measurement 0: x is 'one', expected a number"),
    "covariance": (lambda c: first(c).update(covariance=[1, 2]), "found no covariance of 9 numbers"),
    "not definite": (lambda c: first(c).update(covariance=[-1] * 9), "entry 1, measurement 0: the covariance is not"),
    "degrees": (lambda c: first(c)["measurement"].update(theta=90), "entry 1, measurement 0: dtheta is 90.0"),
    "a prior of no pose": (lambda c: c["measurements"]["a"][0]["measurements"][0].update(key=A + 9),
        "a measurement of pose 9, expected a pose of an edge"),
    "a gap": (lambda c: c["measurements"]["a"].pop(1), "no edge connects pose 0 to pose 1"),
    "twice": (lambda c: c["groundtruth"]["a"].append(c["groundtruth"]["a"][0]),
        "value 4 of the truth: its key occurs"),
    "outliers": (lambda c: c.update(outlier_factors={"a": [3]}), "outlier_factors are no pairs"),
    "entries": (lambda c: c["measurements"].update(a={"x": 1}), "the measurements of a robot are no list"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_a_log_cannot_hold_is_refused_with_its_place(tmp_path: Path, fault: str) -> None:
    change, words = FAULTS[fault]
    path = written(tmp_path, change)
    refused_at(path, words, read, path)


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    found, sentences = survivors(read, written(tmp_path), 600, 1)
    assert len(found) > 20
    assert len(sentences) > 100


def test_values_may_be_under_their_keys_and_the_start_is_the_true_one_without_a_prior(tmp_path: Path) -> None:
    def change(content: dict[str, Any]) -> None:
        values = content["groundtruth"]["a"]
        content["groundtruth"]["a"] = {str(value.pop("key")): value for value in values}
        content["measurements"]["a"][0]["measurements"].pop(0)
        content["outlier_factors"]["a"] = [[2, 1], [2, 2]]

    log, truth = read(written(tmp_path, change))
    assert truth is not None
    assert truth.poses[:, 0].tolist() == [1, 2, 3]
    assert log.prior.pose.tolist() == [1, 2, 0.5]
    assert log.notes["outliers"] == "2, 1 of them loop closures, which alone are marked"


@pytest.mark.slow
def test_a_run_takes_a_log_per_seed_where_its_noise_is_drawn(tmp_path: Path) -> None:
    write_jrl(path := tmp_path / "log.jrl", all_kinds(2))
    drawn = slamduel.run(f'jrl[path="{path}",draw=true]', "graph", seeds=3, out=tmp_path / "drawn").cells
    assert (len(drawn), len({row["digest"] for row in drawn})) == (3, 3)
    assert {row["truth_kind"] for row in drawn} == {"truth"}
    assert len(slamduel.run(f'jrl[path="{path}"]', "graph", seeds=3, out=tmp_path / "one").cells) == 1
