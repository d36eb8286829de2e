"""The walks in GTSAM's wheel, and City10000 with false motions: their truth, and what is false in them."""

from pathlib import Path

import numpy as np
import pytest

from chi2_at_truth import squared
from fuzzing import survivors
from refusals import refused, refused_at
from slamduel.bench.plan.load import load
from slamduel.core.factors import Log, Truth
from slamduel.core.factors.check import problems
from slamduel.core.truth.check import check_truth
from slamduel.datasets.graphs.hypotheses import log_and_truth, read_hypotheses
from slamduel.datasets.published.gtsam_worlds import CITY_SD

ROWS = """\
EDGE2 0 1 1 0 1 1.01 0.01 0.001
EDGE2 1 1 2 0 2 0.99 0.02 0.002 1.5 -1.4 0.8
EDGE2 2 1 3 0 3 0.1 1.8 0.9 2.1 0.4 0.5 1.02 -0.01 1.57
EDGE2 0 1 3 0 2 3.01 0.02 1.56 2.0 0.01 0.0
"""
"""A walk of 3 m that turns left at its end; of the third motion the last hypothesis is right, of the loop the first."""

PATH = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, np.pi / 2]])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (path := tmp_path / "some.txt").write_text(ROWS)
    return path


def made(file: Path, choice: str) -> tuple[Log, Truth]:
    found = log_and_truth(read_hypotheses(file), PATH, np.diag(np.square(CITY_SD)), choice, "some", {})
    assert list(problems(found.log)) == []
    assert found.truth is not None
    check_truth(found.log, found.truth, "some")
    return found.log, found.truth


def test_all_hypotheses_are_in_the_log_and_the_truth_marks_the_false_ones(file: Path) -> None:
    log, truth = made(file, "all")
    np.testing.assert_array_equal(log.delta[3], [0.1, 1.8, 0.9])  # the first of the file is the odometry
    found = np.column_stack((log.loop_to, log.loop_step, log.loop_delta[:, 0])).tolist()
    assert found == [[1, 2, 1.5], [2, 3, 2.1], [2, 3, 1.02], [0, 3, 3.01], [0, 3, 2.0]]
    assert truth.false_loops is not None
    assert truth.false_loops.tolist() == [0, 1, 4]
    assert log.notes["hypotheses"] == "all, of 3 edges that have several; the first is the true one of 2"


@pytest.mark.parametrize(("choice", "last"), [("first", 0.1), ("true", 1.02)])
def test_one_hypothesis_of_each_edge(file: Path, choice: str, last: float) -> None:
    log, truth = made(file, choice)
    assert log.delta[1:, 0].tolist() == [1.01, 0.99, last]
    assert log.loop_delta[:, 0].tolist() == [3.01]
    assert truth.false_loops is None


def test_rows_of_another_length_and_damaged_files_are_refused(file: Path) -> None:
    file.write_text(ROWS.replace("1.01 0.01", "1.01"))
    refused_at(file, "line 1: found 8 words, expected EDGE2", read_hypotheses, file)
    file.write_text(ROWS.replace("EDGE2 1", "EDGE3 1"))
    refused_at(file, "line 2: found 'EDGE3', expected EDGE2", read_hypotheses, file)
    file.write_text(ROWS)
    found, sentences = survivors(lambda _: made(file, "all"), file, 300, 5)
    assert len(found) > 5
    assert len(sentences) > 50


@pytest.mark.parametrize(
    ("name", "sizes", "chi2"),
    [
        ("w10000", (10000, 54312), 0.0018),
        ("w10000[noise=true]", (10000, 54312), 1.0017),
        ("w20000", (20061, 6771), 0.0804),
        ("w20000[noise=true]", (20061, 6771), 1.0029),
    ],
)
def test_the_walks_agree_with_all_of_their_loops(name: str, sizes: tuple[int, int], chi2: float) -> None:
    log, truth = dataset = load(name)
    assert truth is not None
    check_truth(log, truth, name)
    assert (len(log), len(log.loop_to)) == sizes
    assert log.remarks == []
    assert squared(dataset).mean == pytest.approx(chi2, abs=1e-3)


def test_200_motions_of_the_city_have_a_false_second_measurement() -> None:
    log, truth = dataset = load("city10000-ambiguous")
    assert truth is not None
    assert truth.false_loops is not None
    assert (len(log), len(log.loop_to), len(truth.false_loops)) == (10000, 10688 + 200, 200)
    false = truth.false_loops
    np.testing.assert_array_equal(log.loop_step[false] - log.loop_to[false], 1)
    assert squared(dataset).mean == pytest.approx(0.9955, abs=1e-3)
    assert log.notes["hypotheses"] == "all, of 200 edges that have several; the first is the true one of 200"
    only = [load(f"city10000-ambiguous[ambiguous={choice}]").log for choice in ("first", "true")]
    assert only[0].digest == only[1].digest
    assert len(only[0].loop_to) == 10688
    np.testing.assert_array_equal(only[0].delta[1:], log.delta[1:])


def test_a_truth_of_another_length_or_off_the_grid_is_refused(tmp_path: Path) -> None:
    (truth := tmp_path / "truth.txt").write_text("0 0 0\n1 0 0\n")
    refused("found 10000 poses, but 2 true ones", load, f'city10000-ambiguous[truth="{truth}"]')
    truth.write_text("0 0 0\n1 0.2 0\n")
    refused_at(truth, "line 2: the pose is not on a grid", load, f'city10000-ambiguous[truth="{truth}"]')
