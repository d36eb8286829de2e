"""PyFG's graphs: read with their truth, written and read again, or refused with the line."""

from dataclasses import replace
from pathlib import Path

import gtsam
import numpy as np
import pytest

from fuzzing import survivors
from graph_round_trip import all_kinds, assert_same_graph, assert_same_parts, with_parts
from refusals import refused, refused_at
from slamduel.bench.plan.load import load
from slamduel.bench.plan.spec import dataset_variants
from slamduel.core.factors import Dataset, Map
from slamduel.core.factors.check import problems
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import rotation
from slamduel.core.truth.check import check_truth
from slamduel.datasets.graphs.pyfg import read
from slamduel.datasets.graphs.pyfg_write import write_pyfg
from small_log import small_log

SMALL = """\
VERTEX_SE2 0.5 A0 1 2 0.5
VERTEX_SE2 1.5 A2 3 2 0.5
VERTEX_SE2 1.0 A1 2 2 0.5
VERTEX_XY L7 3 4
VERTEX_SE2:PRIOR 0.5 A0 1.1 2.1 0.6 0.01 0.001 0.002 0.02 0.003 0.03

EDGE_SE2 1.0 A0 A1 1 0.1 0.1 0.04 0 0 0.09 0 0.01
EDGE_SE2 1.5 A1 A2 1 0 0.2 0.04 0 0 0.04 0 0.01
EDGE_SE2 1.5 A0 A2 2 0 0.3 0.04 0 0 0.04 0 0.01
EDGE_SE2_XY 1.5 A2 L7 3 4 0.04 0.01 0.09
"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    (path := tmp_path / "small.pyfg").write_text(SMALL)
    return path


def test_the_vertices_are_the_truth_and_the_edges_the_log(small: Path) -> None:
    log, truth = read(small)
    assert list(problems(log)) == []
    assert truth is not None
    check_truth(log, truth, "small")
    assert log.t.tolist() == [0.5, 1.0, 1.5]
    np.testing.assert_array_equal(truth.poses, [[1, 2, 0.5], [2, 2, 0.5], [3, 2, 0.5]])
    assert truth.map is not None
    assert (truth.map.ids.tolist(), truth.map.xy.tolist()) == ([7], [[3, 4]])
    np.testing.assert_array_equal(log.delta[1:], [[1, 0.1, 0.1], [1, 0, 0.2]])
    assert (log.loop_step.tolist(), log.loop_to.tolist()) == ([2], [0])
    np.testing.assert_allclose(log.z, [[5, np.arctan2(4, 3)]])
    J = np.array([[3 / 5, 4 / 5], [-4 / 25, 3 / 25]])
    np.testing.assert_allclose(log.z_cov[0], J @ [[0.04, 0.01], [0.01, 0.09]] @ J.T, rtol=1e-12)
    after = rotation(0.1) @ np.diag([0.04, 0.09, 0.01]) @ rotation(0.1).T
    np.testing.assert_allclose(log.delta_cov[1], after, rtol=1e-12, atol=1e-16)
    stated = np.array([[0.01, 0.001, 0.002], [0.001, 0.02, 0.003], [0.002, 0.003, 0.03]])
    np.testing.assert_allclose(log.prior.cov, rotation(0.6) @ stated @ rotation(0.6).T, rtol=1e-12)
    assert log.prior.pose.tolist() == [1.1, 2.1, 0.6]


def test_times_that_do_not_ascend_are_not_used_and_the_start_is_the_true_one_without_a_prior(small: Path) -> None:
    rows = [row for row in SMALL.splitlines(keepends=True) if "PRIOR" not in row]
    small.write_text("".join(rows).replace("VERTEX_SE2 1.5", "VERTEX_SE2 0.0"))
    log, truth = read(small)
    assert log.t.tolist() == [0, 1, 2]
    assert truth is not None
    assert truth.t.tolist() == [0, 1, 2]
    assert log.prior.pose.tolist() == [1, 2, 0.5]


@pytest.mark.parametrize("seed", range(5))
def test_a_log_comes_back_with_its_factors_its_times_and_its_truth(tmp_path: Path, seed: int) -> None:
    dataset = all_kinds(seed)
    assert write_pyfg(tmp_path / "log.pyfg", dataset) == 0
    (variant,) = dataset_variants(str(tmp_path / "log.pyfg"))
    assert variant.name == "pyfg"
    assert_same_graph(read(tmp_path / "log.pyfg"), dataset, times=True)


def test_what_was_read_can_be_drawn_anew(small: Path) -> None:
    drawn = [load(f'pyfg[path="{small}",draw=true]', seed).log for seed in (0, 1)]
    assert drawn[0].digest != drawn[1].digest
    np.testing.assert_array_equal(drawn[0].z_cov, read(small).log.z_cov)


FAULTS = {
    "EDGE_RANGE 1.5 A2 L7 -5 0.1": "line 12: range is -5.0, expected more than 0",
    "EDGE_RANGE 1.5 A2 L7 5 0": "line 12: crr is 0.0, expected a variance, more than 0",
    "EDGE_RANGE 1.5 A4 L7 5 0.1": "line 12: a measurement of pose 4, expected a pose of an edge or a vertex",
    "EDGE_RANGE 1.5 A2 L7 5": "line 12: found 4 words after EDGE_RANGE, expected 5 (t pose id range var)",
    "VERTEX_XY:PRIOR 0 L7 1 2 1 0 1": "line 12: rows VERTEX_XY:PRIOR are priors of landmarks",
    "VERTEX_SE3:QUAT 0 A4 0 0 0 0 0 0 1": "line 12: rows VERTEX_SE3:QUAT are of a graph in space, 3D",
    "EDGE_SE2_XYZ 0 A0 L7 1 1 1": "line 12: rows EDGE_SE2_XYZ are of a graph in space, 3D",
    "VERTEX_SE2 2.0 B0 1 2 0.5": "line 12: found B0 beside poses of 'A', expected one letter for all poses",
    "EDGE_SE2_XY 1.5 A1 M7 3 4 1 0 1": "line 12: found M7 beside landmarks of 'L'",
    "EDGE_SE2 1.5 A1 2 1 0 0 1 0 0 1 0 1": "line 12: to is '2', expected a letter and a number",
    "EDGE_SE2 1.5 A1 A2 1 0 0 1 0 0 1": "line 12: found 10 words after EDGE_SE2, expected 12",
    "EDGE_SE2 1.5 A1 A2 1 0 one 1 0 0 1 0 1": "line 12: dtheta is 'one'",
    "EDGE_SE2 1.5 A0 A2 1 0 0 -1 0 0 1 0 1": "line 12: the covariance is not positive definite",
    "VERTEX_SE2:PRIOR 1 A1 0 0 0 1 0 0 0 0 1": "line 12: the covariance is not positive definite",
    "VERTEX_SE2 0 A1 0 0 0": "line 12: vertex 1 occurs twice",
    "FIX 0": "line 12: found the tag 'FIX', expected one of VERTEX_SE2",
}


@pytest.mark.parametrize("row", FAULTS)
def test_what_a_log_cannot_hold_is_refused_with_its_line(small: Path, row: str) -> None:
    small.write_text(f"{SMALL}# a comment\n{row}\n")
    refused_at(small, FAULTS[row], read, small)


def test_ranges_alone_and_other_priors_are_read(small: Path) -> None:
    more = (
        "VERTEX_SE2:PRIOR 1 A1 2 3 0.5 0.04 0 0 0.09 0 0.01\nEDGE_RANGE 1.5 A2 L7 5 0.1\nEDGE_RANGE 0.5 A0 L8 2 0.2\n"
    )
    small.write_text(SMALL + more)
    log, _ = read(small)
    assert log.partial is not None
    assert [column.tolist() for column in log.partial.columns.values()] == [
        [0, 1, 1, 2], [8, 7], [RANGE, RANGE], [2, 5], [0.2, 0.1],
    ]  # fmt: skip
    assert log.fixes is not None
    assert (log.fixes.step.tolist(), log.fixes.z.tolist()) == ([1], [[2, 3, 0.5]])
    world = rotation(0.5) @ np.diag([0.04, 0.09, 0.01]) @ rotation(0.5).T
    np.testing.assert_allclose(log.fixes.cov[0], world, rtol=1e-12, atol=1e-16)
    assert log.prior.pose.tolist() == [1.1, 2.1, 0.6]


def test_ranges_and_fixes_come_back_and_other_parts_are_refused(tmp_path: Path) -> None:
    dataset = with_parts(all_kinds(0), RANGE)
    log, truth = dataset
    assert write_pyfg(tmp_path / "log.pyfg", dataset) == 1
    found = read(tmp_path / "log.pyfg")
    assert_same_graph(found, dataset, times=True)
    assert_same_parts(found.log, log)
    bearings = with_parts(all_kinds(0), BEARING)
    refused("has bearings alone, which a PyFG file cannot", write_pyfg, tmp_path / "a", bearings)
    assert log.fixes is not None
    elsewhere = replace(log, fixes=replace(log.fixes, arm=np.ones((3, 2))))
    refused("fixes of an antenna elsewhere, which a PyFG", write_pyfg, tmp_path / "a", Dataset(elsewhere, truth))


def test_the_file_in_gtsams_package_has_ranges_alone() -> None:
    log, _ = read(Path(gtsam.findExampleDataFile("goats_15.pyfg")))
    assert log.partial is not None
    assert (len(log), len(log.ids), len(log.partial)) == (473, 0, 786)
    assert (log.partial.step[0], log.partial.ids[0], log.partial.z[0]) == (1, 0, 340.67912)
    assert set(log.partial.var.tolist()) == {0.5625}


@pytest.mark.parametrize("number", [15, 16])
def test_poses_that_are_dead_reckoning_are_no_truth(number: int) -> None:
    log, truth = read(Path(gtsam.findExampleDataFile(f"goats_{number}.pyfg")))
    assert truth is None
    assert "one after another" in log.notes["truth"]


def test_poses_of_exact_motions_are_the_truth_where_all_else_fits_them(small: Path) -> None:
    """Without noise, dead reckoning is the truth."""
    rows = [row for row in SMALL.splitlines() if row.startswith(("VERTEX_SE2:PRIOR", "VERTEX_XY"))]
    rows += [f"VERTEX_SE2 {k}.0 A{k} {k} 0 0" for k in range(5)]
    rows += [f"EDGE_SE2 {k}.0 A{k - 1} A{k} 1 0 0 0.04 0 0 0.04 0 0.01" for k in range(1, 5)]
    ranges = [f"EDGE_RANGE {k}.0 A{k} L7 {np.hypot(3 - k, 4)} 0.01" for k in range(5)]
    small.write_text("\n".join([*rows, *ranges]))
    assert read(small).truth is not None
    small.write_text("\n".join([*rows, *[row.replace(" 0.01", " 1e-6").replace("L7 ", "L7 1") for row in ranges]]))
    assert read(small).truth is None


def test_damaged_files_are_read_or_refused(small: Path) -> None:
    found, sentences = survivors(read, small, 300, 4)
    assert len(found) > 5
    assert len(sentences) > 50


def test_a_log_without_the_whole_truth_is_not_written(tmp_path: Path) -> None:
    log, truth = all_kinds(0)
    assert truth is not None
    assert truth.map is not None
    path = tmp_path / "log.pyfg"
    refused("no true pose of step 0", write_pyfg, path, Dataset(log, None))
    few = Map(truth.map.ids[:3], truth.map.xy[:3], None)
    refused("no true place of landmark 12", write_pyfg, path, Dataset(log, truth._replace(map=few)))
    refused("has a given map", write_pyfg, path, Dataset(small_log(3), None))
    assert list(tmp_path.iterdir()) == []
