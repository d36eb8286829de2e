"""Graphs in g2o's format: what a row becomes, what is turned down, and logs that go there and back."""

import contextlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from differences import central
from fuzzing import survivors
from graph_round_trip import all_kinds, assert_same_parts, with_parts
from refusals import refusal, refused, refused_at
from slamduel.core import files
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Log, Map
from slamduel.core.factors.check import problems
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import Array, inverse, rotation
from slamduel.datasets.cache import generator
from slamduel.datasets.formats import g2o, g2o_write
from slamduel.datasets.formats.g2o_write import write_g2o
from slamduel.datasets.registry import find
from small_log import small_log

SMALL = """# a comment
VERTEX_SE2 10 1 2 0.5
VERTEX_SE2 12 9 9 9e-1
VERTEX_SE2 11 3 3 3
VERTEX_XY 3 4 4
EDGE_PRIOR_SE2 10 1.5 2.5 0.25 100 10 1 200 2 300
EDGE_SE2 10 11 1 0.1 0.2 10 1 0.5 20 0.25 30
EDGE_SE2 12 11 -1 0.2 -0.3 11 1 0.5 21 0.25 31

EDGE_SE2 10 12 2 0.3 0.5 12 1 0.5 22 0.25 32
EDGE_SE2 11 12 1 0.3 0.4 13 1 0.5 23 0.25 33
EDGE_SE2_XY 12 3 3 4 50 5 60
EDGE_SE2_XY 10 3 1 -2 50 5 60
EDGE_SE2_XY 10 4 0 2 50 5 60
"""
"""Three poses, an edge the wrong way round, a second one beside it and a loop; two points."""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.g2o"
    path.write_text(SMALL)
    return path


def square(*triangle: float) -> Array:
    k = {3: 2, 6: 3}[len(triangle)]
    upper = np.zeros((k, k))
    upper[np.triu_indices(k)] = triangle
    return upper + np.triu(upper, 1).T


def sampled(information: Array, place: Callable[[Array], Array]) -> Array:
    """The covariance of `place`, a function of a small error with this information, by central differences."""
    J = central(place, np.zeros(len(information)))
    return J @ np.linalg.inv(information) @ J.T


def polar(x: float, y: float) -> Array:
    return np.array([np.hypot(x, y), np.arctan2(y, x)])


def plain(pose: gtsam.Pose2) -> Array:
    return np.array([pose.x(), pose.y(), pose.theta()])


def test_poses_are_steps_in_the_order_of_their_ids(small: Path) -> None:
    log = g2o.read(small).log
    assert len(log) == 3
    np.testing.assert_array_equal(log.t, [0, 1, 2])
    np.testing.assert_array_equal(log.delta[1], [1, 0.1, 0.2])
    np.testing.assert_array_equal(log.delta[2], inverse(np.array([-1, 0.2, -0.3])))
    np.testing.assert_array_equal(log.loop_step, [2, 2])
    np.testing.assert_array_equal(log.loop_to, [0, 1])
    np.testing.assert_array_equal(log.loop_delta, [[2, 0.3, 0.5], [1, 0.3, 0.4]])
    np.testing.assert_array_equal(log.sighting_step, [0, 0, 2])
    np.testing.assert_array_equal(log.ids, [3, 4, 3])
    np.testing.assert_allclose(log.z, [[5**0.5, np.arctan2(-2, 1)], [2, np.pi / 2], [5, np.arctan2(4, 3)]])
    assert log.notes["first_guesses_not_used"] == 4
    assert log.notes["edges_inverted"] == 1
    assert log.notes["edges_beside_the_odometry_of_their_step"] == 1


def test_an_information_is_of_the_error_that_g2o_defines(small: Path) -> None:
    """Z^-1 (Xi^-1 Xj): an error is a motion after the measured one, and first order is gtsam's own retraction."""
    log = g2o.read(small).log
    forward = gtsam.Pose2(1, 0.1, 0.2)
    expected = sampled(square(10, 1, 0.5, 20, 0.25, 30), lambda e: plain(forward.retract(e)))
    np.testing.assert_allclose(log.delta_cov[1], expected, rtol=1e-7)
    back = gtsam.Pose2(-1, 0.2, -0.3)
    expected = sampled(square(11, 1, 0.5, 21, 0.25, 31), lambda e: plain(back.retract(e).inverse()))
    np.testing.assert_allclose(log.delta_cov[2], expected, rtol=1e-7)
    loop = gtsam.Pose2(2, 0.3, 0.5)
    expected = sampled(square(12, 1, 0.5, 22, 0.25, 32), lambda e: plain(loop.retract(e)))
    np.testing.assert_allclose(log.loop_cov[0], expected, rtol=1e-7)
    expected = sampled(square(50, 5, 60), lambda e: polar(3 + e[0], 4 + e[1]))
    np.testing.assert_allclose(log.z_cov[2], expected, rtol=1e-7)
    start = gtsam.Pose2(1.5, 2.5, 0.25)
    expected = sampled(square(100, 10, 1, 200, 2, 300), lambda e: plain(start.retract(e)))
    np.testing.assert_allclose(log.prior.cov, expected, rtol=1e-7)
    np.testing.assert_array_equal(log.prior.pose, [1.5, 2.5, 0.25])


def test_without_a_belief_the_first_pose_is_held_where_it_is_put(small: Path) -> None:
    text = SMALL.replace("EDGE_PRIOR_SE2 10 1.5 2.5 0.25 100 10 1 200 2 300\n", "")
    small.write_text(text)
    held = g2o.read(small).log
    np.testing.assert_array_equal(held.prior.pose, [1, 2, 0.5])
    np.testing.assert_array_equal(held.prior.cov, 1e-9 * np.eye(3))
    assert held.prior.map is None
    small.write_text(text + "FIX 10 3\n")
    fixed = g2o.read(small).log
    np.testing.assert_array_equal(fixed.prior.pose, [1, 2, 0.5])
    np.testing.assert_array_equal(fixed.prior.map.ids, [3])
    np.testing.assert_array_equal(fixed.prior.map.xy, [[4, 4]])
    small.write_text("".join(line + "\n" for line in text.split("\n") if not line.startswith("VERTEX")))
    np.testing.assert_array_equal(g2o.read(small).log.prior.pose, [0, 0, 0])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("EDGE_SE2 10 12 2", "EDGE_SE2 10 12", "line 10: found 10 numbers after the tag, expected 11 (from to dx"),
        ("EDGE_SE2_XY 12 3 3", "EDGE_SE2_XY 12 3 3e9", "line 12: x is 3000000000.0, expected -1e+09 to 1e+09"),
        ("EDGE_SE2 10 12 2", "EDGE_SE2 10 12 -1e20", "line 10: dx is -1e+20, expected -1e+09 to 1e+09"),
        ("EDGE_SE2_XY 12 3 3", "EDGE_SE2_XY 12 3 nan", "line 12: x is nan, expected a finite number"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 12 3.5", "line 12: id is 3.5, expected a whole number up to"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 12 -3", "line 5: id is 3, expected one below 0, as other points have"),
        ("VERTEX_SE2 11", "VERTEX_SE2 -11", "line 4: id is -11, expected 0 or more"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 12 9e15", "line 12: id is 9000000000000000"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 12 1e16", "line 12: id is 1e+16, expected a whole number up to"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 12 11", "line 12: id 11 is used for a point and a pose"),
        ("VERTEX_XY 3", "VERTEX_XY 12", "line 5: id 12 is used for a point and a pose"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 99 3", "line 12: a sighting from pose 99, expected a pose of"),
        ("EDGE_SE2_XY 10 4 0 2", "EDGE_SE2_XY 10 3 0 2", "line 14: id 3 occurs twice in step 0"),
        ("EDGE_SE2_XY 10 4 0 2", "EDGE_SE2_XY 10 4 0 0", "line 14: x and y are both 0"),
        ("4 50 5 60", "4 5 50 60", "line 12: the information is not positive definite"),
        ("12 1 0.5 22", "0 0 0 22", "line 10: the information is not positive definite"),
        ("100 10 1", "0 10 1", "line 6: the information is not positive definite"),
        ("EDGE_SE2 10 11 1", "EDGE_SE2 11 11 1", "line 7: an edge from pose 11 to itself"),
        ("EDGE_SE2 10 11 1", "EDGE_SE2 11 10 1", ""),
        ("EDGE_SE2 10 11 1", "EDGE_SE2 10 12 1", "no edge connects pose 10 to pose 11, the next by id"),
        ("0.2 10 1", "20 10 1", "line 7: dtheta is 20.0, expected radians"),
        ("0.2 10 1", "6.2 10 1", ""),
        ("VERTEX_SE2 11", "VERTEX_SE2 10", "line 4: vertex 10 occurs twice"),
        ("EDGE_PRIOR_SE2 10", "EDGE_PRIOR_SE2 99", "line 6: a measurement of pose 99, expected a pose of an edge"),
        ("VERTEX_XY 3 4 4", "FIX 10", "line 5: the first pose has two priors"),
        ("VERTEX_XY 3 4 4", "FIX 12", "line 5: vertex 12 is fixed, expected only that of the first pose, 10"),
        ("VERTEX_XY 3 4 4", "FIX", "line 5: found 0 numbers after the tag, expected 1 (id)"),
        ("EDGE_SE2 10 12", "EDGE_SE2_OFFSET 10 12", "line 10: rows EDGE_SE2_OFFSET are not supported"),
        ("EDGE_SE2 10 12", "VERTEX_SE3:QUAT 10 12", "line 10: rows VERTEX_SE3:QUAT are of a graph in space, 3D, exp"),
        ("EDGE_SE2 10 12", "VERTEX_TRACKXYZ 10 12", "line 10: rows VERTEX_TRACKXYZ are of a graph in space, 3D, exp"),
        ("EDGE_SE2 10 12", "EDGE_SE4 10 12", "line 10: found the tag 'EDGE_SE4', expected one of VERTEX"),
        (SMALL, "# nothing\n", "found no poses, expected at least one"),
        (SMALL, "\n", "the file is empty"),
        ("EDGE_SE2_XY 12 3", "EDGE_SE2_XY 12 1_0", "line 12: id is '1_0', expected a number"),
    ],
)  # fmt: skip
def test_a_row_that_cannot_be_used_is_named(small: Path, old: str, new: str, words: str) -> None:
    assert old in SMALL
    small.write_text(SMALL.replace(old, new))
    if not words or "id is 9000000000000000" in words:  # as good as the file was
        g2o.read(small)
        return
    refused_at(small, words, g2o.read, small)


PRIOR = "EDGE_PRIOR_SE2 10 1.5 2.5 0.25 100 10 1 200 2 300\n"


def test_another_pose_that_is_fixed_only_says_where_the_graph_is(small: Path) -> None:
    bare = SMALL.replace(PRIOR, "")
    small.write_text(bare)
    expected = g2o.read(small).log
    small.write_text(bare + "FIX 11\n")
    log = g2o.read(small).log
    assert log.digest == expected.digest
    (remark,) = log.remarks
    assert "FIX holds pose 11, a log the first, 10, at its initial value: the graph is the same" in remark
    assert expected.remarks == []
    for rows in ("FIX 11 12\n", "FIX 10 11\n", "FIX 11 3\n", "FIX 99\n", f"FIX 11\n{PRIOR}"):  # no mere place
        small.write_text(bare + rows)
        refused(r"vertex (11|12|99) is fixed, expected only that of the first pose, 10", g2o.read, small)


def test_landmarks_of_rtabmap_have_negative_ids(small: Path) -> None:
    """The numbers of poses and points are then others': 11 and -11, too."""
    expected = g2o.read(small).log
    rows = [list[str](line.split(" ")) for line in (SMALL + "FIX 3\n").split("\n")]
    for row in rows:
        word = {"EDGE_SE2_XY": 2, "VERTEX_XY": 1, "FIX": 1}.get(row[0])
        if word is not None:
            row[word] = {"3": "-11", "4": "-1"}[row[word]]
    small.write_text("\n".join(" ".join(row) for row in rows))
    log = g2o.read(small).log
    assert log.ids.tolist() == [{3: 11, 4: 1}[name] for name in expected.ids.tolist()]
    np.testing.assert_array_equal(log.z, expected.z)
    np.testing.assert_array_equal(log.delta, expected.delta)
    assert log.prior.map is not None
    assert (log.prior.map.ids.tolist(), log.prior.map.xy.tolist()) == ([11], [[4, 4]])
    assert log.notes["landmarks"] == "their negative ids without the sign"


def symbol(letter: str, number: int) -> str:
    return str(ord(letter) << 56 | number)


@pytest.mark.parametrize("plain_poses", [False, True])
def test_ids_may_be_gtsams_symbols(small: Path, plain_poses: bool) -> None:
    """x10 and l3; poses and points may have the same numbers."""
    expected = g2o.read(small).log
    rows = [list[str](line.split(" ")) for line in (SMALL.replace(PRIOR, "") + "FIX 10 3\n").split("\n")]

    def pose(word: str) -> str:
        return word if plain_poses else symbol("x", int(word) - 7)  # 3, 4, 5

    for row in rows:
        if row[0] in ("EDGE_SE2", "VERTEX_SE2", "EDGE_SE2_XY", "FIX"):
            row[1] = pose(row[1])
        if row[0] == "EDGE_SE2":
            row[2] = pose(row[2])
        word = {"EDGE_SE2_XY": 2, "FIX": 2, "VERTEX_XY": 1}.get(row[0])
        if word is not None:
            row[word] = symbol("l", int(row[word]))
    small.write_text("\n".join(" ".join(row) for row in rows))
    log = g2o.read(small).log
    np.testing.assert_array_equal(log.ids, expected.ids)
    for name in ("delta", "delta_cov", "z", "z_cov", "loop_to", "loop_step"):
        np.testing.assert_array_equal(getattr(log, name), getattr(expected, name))
    assert log.prior.map is not None
    assert log.prior.map.ids.tolist() == [3]
    np.testing.assert_array_equal(log.prior.pose, [1, 2, 0.5])


def test_symbols_of_several_robots_are_refused(small: Path) -> None:
    two = SMALL.replace("EDGE_SE2 10 12", f"EDGE_SE2 {symbol('a', 10)} {symbol('b', 12)}")
    small.write_text(two)
    refused_at(
        small,
        "line 10: found the symbol a10 beside others of '\\x00', expected one letter for all poses",
        g2o.read,
        small,
    )
    alike = SMALL.replace("\nEDGE_SE2_XY 12 3", f"\nEDGE_SE2_XY {symbol('x', 12)} {symbol('x', 3)}")
    small.write_text("\n".join(line for line in alike.split("\n") if line.startswith("EDGE_SE2_XY 8")))
    refused("found poses and points of one letter, 'x', expected two", g2o.read, small)


def test_gtsam_writes_such_symbols(tmp_path: Path) -> None:
    graph = gtsam.NonlinearFactorGraph()
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.05]))
    values = gtsam.Values()
    for k in range(3):
        values.insert(gtsam.symbol("x", k), gtsam.Pose2(k, 0, 0))
        if k:
            graph.add(
                gtsam.BetweenFactorPose2(gtsam.symbol("x", k - 1), gtsam.symbol("x", k), gtsam.Pose2(1, 0, 0), noise)
            )
    gtsam.writeG2o(graph, values, str(tmp_path / "graph.g2o"))
    log = g2o.read(tmp_path / "graph.g2o").log
    assert len(log) == 3
    np.testing.assert_allclose(log.delta[1:], [[1, 0, 0], [1, 0, 0]])


def test_huge_ids_take_no_room(small: Path) -> None:
    huge = {"12": str(2**53), "3": str(2**53 - 2)}
    rows = [list[str](line.split(" ")) for line in SMALL.split("\n")]
    for line in rows:
        ends = 3 if line[0] in ("EDGE_SE2", "EDGE_SE2_XY") else 2
        line[:ends] = [huge.get(word, word) for word in line[:ends]]
    small.write_text("\n".join(" ".join(row) for row in rows))
    log = g2o.read(small).log
    assert len(log) == 3
    assert log.ids.max() == 2**53 - 2


def without_given_covariance(parts: dict[str, Any]) -> None:
    known = parts["prior"].map
    parts["prior"] = parts["prior"]._replace(map=Map(known.ids, known.xy, None))


def assert_same_factors(found: Log, log: Log, rtol: float) -> None:
    """All but the times, the name and the sightings of unknown landmarks; covariances against their own scale."""
    log = log.identified()
    for name in ("delta", "z", "loop_delta"):
        np.testing.assert_allclose(getattr(found, name), getattr(log, name), rtol=1e-14, atol=1e-14)
    for name in ("ids", "loop_to", "sighting_first", "loop_first"):
        np.testing.assert_array_equal(getattr(found, name), getattr(log, name))
    pairs = [(getattr(found, name), getattr(log, name)) for name in ("z_cov", "loop_cov")]
    for one, other in (*pairs, (found.delta_cov[1:], log.delta_cov[1:]), (found.prior.cov[None], log.prior.cov[None])):
        sd = np.sqrt(np.einsum("nii->ni", other))
        assert (np.abs(one - other) <= rtol * sd[:, :, None] * sd[:, None, :]).all()
    np.testing.assert_array_equal(found.prior.pose, log.prior.pose)
    assert (found.prior.map is None) == (log.prior.map is None)
    if log.prior.map is not None:
        np.testing.assert_array_equal(found.prior.map.ids, log.prior.map.ids)
        np.testing.assert_array_equal(found.prior.map.xy, log.prior.map.xy)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32 - 1))
def test_a_log_comes_back_with_the_same_factors(tmp_path: Path, seed: int) -> None:
    log = small_log(seed, without_given_covariance)
    assert write_g2o(tmp_path / "log.g2o", log) == 2
    assert_same_factors(g2o.read(tmp_path / "log.g2o").log, log, rtol=1e-12)


@pytest.mark.parametrize(("name", "options"), [("city", {"landmarks": 60, "steps": 300}), ("circle", {"steps": 300})])
def test_simulated_logs_come_back(name: str, options: dict[str, int], tmp_path: Path) -> None:
    """A robot that rolls hardly slides: its covariances have a condition of 1e4, which costs as many digits."""
    source = find(name)
    log = source.make(source.options(**options), generator(name, 1)).log
    write_g2o(tmp_path / "log.g2o", log)
    assert_same_factors(g2o.read(tmp_path / "log.g2o").log, log, rtol=1e-11)


def test_a_log_of_more_rows_than_are_written_at_once_is_the_same_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = find("city")
    log = source.make(source.options(landmarks=60, steps=50), generator("city", 1)).log
    write_g2o(tmp_path / "whole.g2o", log)
    monkeypatch.setattr(g2o_write, "CHUNK", 7)
    monkeypatch.setattr(files, "BLOCK", 5)
    write_g2o(tmp_path / "parts.g2o", log)
    assert (tmp_path / "parts.g2o").read_bytes() == (tmp_path / "whole.g2o").read_bytes()


def test_bearings_alone_and_priors_of_other_poses_are_read(small: Path) -> None:
    more = (
        "EDGE_BEARING_SE2_XY 11 7 0.4 25\nEDGE_PRIOR_SE2 12 1 2 0.5 100 0 0 25 0 400\nEDGE_PRIOR_SE2_XY 11 5 6 4 0 1\n"
    )
    small.write_text(SMALL + more)
    log = g2o.read(small).log
    assert log.partial is not None
    first, *columns, var = (column.tolist() for column in log.partial.columns.values())
    assert (first, columns, var) == ([0, 0, 1, 1], [[7], [BEARING], [0.4]], [pytest.approx(0.04)])
    assert log.fixes is not None
    assert log.fixes.step.tolist() == [1, 2]
    np.testing.assert_array_equal(log.fixes.z, [[5, 6, np.nan], [1, 2, 0.5]])
    np.testing.assert_allclose(log.fixes.cov[0, :2, :2], np.diag([0.25, 1]))
    turned = rotation(0.5)
    np.testing.assert_allclose(log.fixes.cov[1], turned @ np.diag([0.01, 0.04, 0.0025]) @ turned.T, atol=1e-15)
    np.testing.assert_array_equal(log.prior.pose, [1.5, 2.5, 0.25])


def test_bearings_and_fixes_come_back_and_ranges_are_refused(tmp_path: Path) -> None:
    log = with_parts(all_kinds(0), BEARING).log
    assert log.fixes is not None
    z, cov = log.fixes.z.copy(), log.fixes.cov.copy()
    z[2, 2], cov[2, 2], cov[2, :, 2] = np.nan, np.nan, np.nan
    fixes = replace(log.fixes, z=z, cov=cov)
    log = replace(log, fixes=fixes)
    assert write_g2o(tmp_path / "log.g2o", log) == 1
    assert_same_parts(g2o.read(tmp_path / "log.g2o").log, log)
    refused("has ranges alone, which a g2o file cannot", write_g2o, tmp_path / "a", with_parts(all_kinds(0), RANGE).log)
    refused("which gtsam.readG2o cannot read", write_g2o, tmp_path / "a", log, True)
    z[1, 0], cov[1, 0], cov[1, :, 0] = np.nan, np.nan, np.nan
    part = replace(log, fixes=replace(fixes, z=z, cov=cov))
    refused("fixes of a part of a pose, which a g2o file", write_g2o, tmp_path / "a", part)


def test_a_landmark_that_bearings_alone_see_starts_on_the_first(tmp_path: Path) -> None:
    log = with_parts(all_kinds(0), BEARING).log
    assert log.partial is not None
    ids = np.array([99, 3, 9, 3])
    log = replace(log, partial=replace(log.partial, ids=ids))
    write_g2o(tmp_path / "log.g2o", log)
    rows = [line.split() for line in (tmp_path / "log.g2o").read_text().split("\n") if line.startswith("VERTEX_XY 99 ")]
    bearing = log.prior.pose[2] + log.partial.z[0]
    expected = log.prior.pose[:2] + np.array([np.cos(bearing), np.sin(bearing)])
    np.testing.assert_allclose(np.array(rows[0][2:], float), expected, atol=1e-12)


def test_an_optimiser_starts_from_dead_reckoning(tmp_path: Path) -> None:
    """Landmarks are put where their first sighting has them."""
    log = small_log(3, without_map)
    path = log.dead_reckoned()
    write_g2o(tmp_path / "log.g2o", log)
    rows = [line.split() for line in (tmp_path / "log.g2o").read_text().split("\n")]
    found = np.array([row[2:] for row in rows if row and row[0] == "VERTEX_SE2"], float)
    np.testing.assert_array_equal(found, path)
    places = {int(row[1]): np.array(row[2:], float) for row in rows if row and row[0] == "VERTEX_XY"}
    assert places.keys() == {3, 8, 12}
    r, bearing = log.z[5]
    there = path[5, :2] + rotation(path[5, 2])[:2, :2] @ [r * np.cos(bearing), r * np.sin(bearing)]
    np.testing.assert_allclose(places[12], there, atol=1e-12)


def without_map(parts: dict[str, Any]) -> None:
    parts["prior"] = parts["prior"]._replace(map=None)


def with_a_large_id(parts: dict[str, Any]) -> None:
    without_map(parts)
    parts["ids"][4] = 2**31


@pytest.mark.parametrize(
    ("change", "for_gtsam", "words"),
    [
        (None, False, "has a map with covariance, which a g2o file cannot represent"),
        (with_a_large_id, False, "expected at most 2147483647, g2o's largest"),
        (without_map, True, "range and bearing of sighting 0 are correlated"),
    ],
)
def test_what_g2o_cannot_hold_is_a_sentence(change: Any, for_gtsam: bool, words: str, tmp_path: Path) -> None:
    assert words in refusal(write_g2o, tmp_path / "log.g2o", small_log(1, change), for_gtsam=for_gtsam)
    assert list(tmp_path.iterdir()) == []


def fit(dataset: Dataset) -> None:
    assert list(problems(dataset.log)) == []
    assert dataset.truth is None


def test_damaged_files_load_or_are_turned_down(small: Path) -> None:
    found, sentences = survivors(g2o.read, small, 360, 1, fit)
    assert len(found) > 50
    assert len(sentences) > 150


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(
            st.sampled_from([*g2o.KINDS, "EDGE_SE2", "EDGE_SE2", "EDGE_SE2_XY"]),
            st.lists(st.one_of(st.integers(0, 4), st.floats(), st.integers()), min_size=0, max_size=11),
        ),
        max_size=8,
    )
)
def test_any_rows_load_or_are_turned_down(tmp_path: Path, rows: list[tuple[str, list[float]]]) -> None:
    path = tmp_path / "any.g2o"
    path.write_text("".join(f"{tag} {' '.join(map(repr, numbers))}\n" for tag, numbers in rows))
    with contextlib.suppress(InputError):  # anything else goes through
        fit(g2o.read(path))


@pytest.mark.parametrize("name", ["g2o", "gtsam", "toro"])
def test_the_file_has_to_be_named(name: str) -> None:
    source = find(name)
    refused(rf"{name}\[path=FILE\]", source.make, source.options(), np.random.default_rng(0))
