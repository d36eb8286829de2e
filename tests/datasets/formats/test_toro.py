"""Graphs in TORO's format: the order of its information, and the frame that its own error function has it in."""

from pathlib import Path

import numpy as np
import pytest

from refusals import refused_at
from slamduel.core.se2 import Array, between, compose, rotation, wrap
from slamduel.datasets.formats import gtsam_text, toro

FIRST, SECOND = np.array([1.0, 2.0, 0.7]), np.array([1.9, 2.9, 1.6])
FORWARD = "EDGE2 0 1 1.1 0.2 0.8 10 1 20 30 0.5 0.25\n"
INFORMATION = np.array([[10, 1, 0.5], [1, 20, 0.25], [0.5, 0.25, 30]])


def toro_error(start: Array, end: Array, motion: Array, information: Array) -> float:
    """TreeOptimizer2::error of TORO, written down anew: the difference in the world, weighed by R I R'."""
    off = compose(start, motion) - end
    off[2] = wrap(off[2])
    R = rotation(start[2])
    return float(off @ (R @ information @ R.T) @ off)


def our_error(start: Array, end: Array, motion: Array, cov: Array) -> float:
    off = between(start, end) - motion
    off[2] = wrap(off[2])
    return float(off @ np.linalg.solve(cov, off))


def test_the_error_is_toro_s_own(tmp_path: Path) -> None:
    path = tmp_path / "two.toro"
    path.write_text(FORWARD)
    log = toro.read(path).log
    np.testing.assert_array_equal(log.delta[1], [1.1, 0.2, 0.8])
    expected = toro_error(FIRST, SECOND, np.array([1.1, 0.2, 0.8]), INFORMATION)
    assert our_error(FIRST, SECOND, log.delta[1], log.delta_cov[1]) == pytest.approx(expected, rel=1e-12)


def test_an_edge_the_other_way_round_is_the_same_to_first_order(tmp_path: Path) -> None:
    path = tmp_path / "two.toro"
    path.write_text("VERTEX2 0 0 0 0\nVERTEX2 1 0 0 0\n" + FORWARD.replace("0 1", "1 0", 1))
    log = toro.read(path).log
    assert log.notes["edges_inverted"] == 1
    there = compose(FIRST, log.delta[1])
    for _ in range(5):
        small = there + 1e-6 * np.random.default_rng(1).normal(size=3)
        expected = toro_error(small, FIRST, np.array([1.1, 0.2, 0.8]), INFORMATION)
        assert our_error(FIRST, small, log.delta[1], log.delta_cov[1]) == pytest.approx(expected, rel=1e-4)


def test_isotropic_graphs_are_what_gtsam_reads() -> None:
    path = gtsam_text.shipped("w100.graph")
    found, other = toro.read(path).log, gtsam_text.read(path).log
    assert len(found) == 100
    assert len(found.loop_to) == 201
    for name in ("delta", "delta_cov", "loop_to", "loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(found, name), getattr(other, name), atol=1e-12)
    assert found.notes["equivalences_not_used"] == 40


def test_equivalences_are_a_remark(tmp_path: Path) -> None:
    path = tmp_path / "two.toro"
    for rows, said in (
        ("", []),
        ("EQUIV 0 1\n", ["the EQUIV rows (1), of"]),
        ("EQUIV 0 1\n" * 3, ["the EQUIV rows (3), of"]),
    ):
        path.write_text("EDGE2 0 1 1.1 0.2 0.8 10 0 20 30 0 0\n" + rows)
        for read in (toro.read, gtsam_text.read):
            found = read(path).log.remarks
            assert len(found) == len(said)
            assert all(f"{path}: {one}" in remark for one, remark in zip(said, found, strict=True))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("EDGE2 0 1 1 0 0 1 0 0 1 0 1\n", "line 1: the information is not positive definite"),  # in g2o's order
        ("VERTEX2 0 0 0 0\nVERTEX2 1 0 0 0\n", "no edge connects pose 0 to pose 1, the next by id"),
        ("VERTEX3 0 0 0 0 0 0 0\n", "line 1: rows VERTEX3 are of a graph in space, 3D"),
        ("EQUIV 1 2\n", "found no poses, expected at least one"),
    ],
)
def test_what_cannot_be_used_is_named(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.toro"
    path.write_text(text)
    refused_at(path, words, toro.read, path)
