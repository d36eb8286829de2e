"""Relations: places beside a path's steps, and errors, against plain matrices."""

import numpy as np

from slamduel.bench.measure.relations import STRETCHES, counted_relations, relation_columns, standard_error
from slamduel.core.relations import FEWEST_EXACT, Anchors, Relations, as_rows, from_rows
from slamduel.core.se2 import Array, between, compose

RNG = np.random.default_rng(5)
N, M = 30, 600


def matrix(pose: Array) -> Array:
    x, y, a = pose
    return np.array([[np.cos(a), -np.sin(a), x], [np.sin(a), np.cos(a), y], [0, 0, 1]])


def poses(m: int, turn: float = np.pi) -> Array:
    return np.column_stack((RNG.normal(0, 5, (m, 2)), RNG.uniform(-turn, turn, m)))


def some(exact: int, path: Array) -> Relations:
    """True of `path`."""
    ends: list[Anchors] = []
    for _ in range(2):
        step = RNG.integers(0, N, M)
        since = np.column_stack((RNG.normal(0, 0.2, (M, 2)), RNG.uniform(-0.3, 0.3, M)))
        until = between(path[np.minimum(step + 1, N - 1)], compose(path[step], since))
        ends.append(Anchors(step, since, until, RNG.random(M)))
    delta = between(ends[0].along(path), ends[1].along(path))
    return Relations(ends[0], ends[1], delta, np.arange(M) < exact)


def test_on_the_path_they_were_made_of_nothing_is_off() -> None:
    path = poses(N)
    relations = some(M, path)
    assert np.abs(relations.first.along(path) - compose(path[relations.first.step], relations.first.since)).max() < 1e-9
    assert relations.errors(path).max() < 1e-9


def test_errors_are_those_of_plain_matrices() -> None:
    path = poses(N)
    relations = some(M, path)
    other = compose(path, np.column_stack((RNG.normal(0, 0.1, (N, 2)), RNG.normal(0, 0.05, N))))
    found = relations.errors(other)
    for k in range(M):
        placed = list[Array]()
        for ends in (relations.first, relations.second):
            step = int(ends.step[k])
            before = matrix(other[step]) @ matrix(ends.since[k])
            behind = matrix(other[min(step + 1, N - 1)]) @ matrix(ends.until[k])
            off, share = np.linalg.solve(before, behind), ends.share[k]
            turn = np.arctan2(off[1, 0], off[0, 0])
            placed.append(before @ matrix(share * np.array((off[0, 2], off[1, 2], turn))))
        error = np.linalg.solve(matrix(relations.delta[k]), np.linalg.solve(placed[0], placed[1]))
        assert abs(found[k, 0] - np.hypot(error[0, 2], error[1, 2])) < 1e-9
        assert abs(found[k, 1] - abs(np.arctan2(error[1, 0], error[0, 0]))) < 1e-9


def test_a_frame_of_its_own_changes_nothing() -> None:
    path = poses(N)
    relations = some(M, poses(N))
    moved = compose(np.broadcast_to(np.array((40.0, -7.0, 2.0)), path.shape), path)
    assert np.abs(relations.errors(path) - relations.errors(moved)).max() < 1e-9


def test_exact_ones_alone_are_judged_where_they_are_enough() -> None:
    path = poses(N)
    few, enough = some(FEWEST_EXACT - 1, path), some(FEWEST_EXACT, path)
    other = path + RNG.normal(0, 0.1, path.shape)
    assert counted_relations(few) == {"relations": M, "relations_exact": FEWEST_EXACT - 1}
    assert counted_relations(enough) == {"relations": FEWEST_EXACT, "relations_exact": FEWEST_EXACT}
    row, errors = relation_columns(few, other), few.errors(other)
    assert row["relation_m"] == errors[:, 0].mean()
    assert row["relation_max_deg"] == np.degrees(errors[:, 1]).max()
    row, errors = relation_columns(enough, other), enough.errors(other)[:FEWEST_EXACT]
    assert abs(row["relation_m"] - errors[:, 0].mean()) < 1e-12
    assert abs(row["relation_sd_deg"] - np.degrees(errors[:, 1]).std()) < 1e-12


def test_a_standard_error_is_that_of_means_over_logs() -> None:
    logs, n, alike = 2000, 400, 10
    errors = np.repeat(np.random.default_rng(5).normal(1.0, 0.3, (logs, n // alike)), alike, axis=1)
    squares = np.array([standard_error(row) for row in errors], float) ** 2
    true = 0.3**2 * alike / n  # ten neighbours with one error
    assert abs(squares.mean() / true - 1) < 6 * np.sqrt(2 / (STRETCHES - 1) / logs)
    assert standard_error(errors[0, : 2 * STRETCHES - 1]) is None


def test_a_standard_error_goes_by_time_and_not_by_rows() -> None:
    path = poses(N)
    relations = some(FEWEST_EXACT, path)
    other = path + np.cumsum(RNG.normal(0, 0.01, path.shape), axis=0)
    shuffled = RNG.permutation(len(relations.delta))
    ends = relations.first.taken(shuffled), relations.second.taken(shuffled)
    mixed = Relations(*ends, relations.delta[shuffled], relations.exact[shuffled])
    assert len(set(relations.first.step.tolist())) < len(relations.delta)  # some begin at one step: in any order
    row, again = relation_columns(relations, other), relation_columns(mixed, other)
    assert abs(row["relation_se_m"] / again["relation_se_m"] - 1) < 0.1
    apart = standard_error(relations.judged().errors(other)[RNG.permutation(FEWEST_EXACT), 0])
    assert apart is not None
    assert apart < 0.75 * row["relation_se_m"]


def test_a_table_holds_everything() -> None:
    relations = some(100, poses(N))
    again = from_rows(as_rows(relations))
    assert (as_rows(again) == as_rows(relations)).all()
    assert (again.first.step == relations.first.step).all()
    assert (again.second.until == relations.second.until).all()
    assert again.exact.sum() == 100
