import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refusals import refusal, refused
from slamduel.core.factors import UNKNOWN, Log, Map, Prior, Truth
from slamduel.core.factors.check import check, problems
from slamduel.core.se2 import Array
from slamduel.core.truth.check import check_truth
from slamduel.datasets.formats import log_folder
from small_log import positive_definite, small_log

Change = Callable[[dict[str, Any]], Any]
NAN, INF = np.nan, np.inf
SINGULAR = np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])


def test_a_good_log_has_no_problem():
    assert list(problems(small_log())) == []
    check(small_log(), where="small")


def put(name: str, place: Any, value: Any) -> Change:
    return lambda parts: parts[name].__setitem__(place, value)


def prior(**fields: Any) -> Change:
    return lambda parts: parts.update(prior=parts["prior"]._replace(**fields))


def known(ids: Any = (3, 8), xy: Any = ((0.0, 1.0), (2.0, 3.0)), cov: Array | None = None) -> Change:
    return prior(map=Map(np.array(ids), np.array(xy), cov))


BAD: dict[str, tuple[Change, str, int, str]] = {
    "a NaN in the prior": (prior(pose=np.array([0, NAN, 0])), "prior", 0, "y is nan, expected a finite number"),
    "a heading in degrees": (prior(pose=np.array([0, 0, 90.0])), "prior", 0, "heading is 90.0, expected radians"),
    "a singular prior": (prior(cov=np.zeros((3, 3))), "prior", 0, "smallest eigenvalue is 0"),
    "an uneven prior": (prior(cov=np.eye(3) + np.eye(3, k=1) / 2), "prior", 0, "not symmetric"),
    "a prior of another size": (prior(cov=np.eye(2)), "prior", 0, "(3,) and (3, 3)"),
    "a negative id in the map": (known(ids=(3, -1)), "prior", 1, "id is -1, expected 0 to 9007199254740992"),
    "one id twice in the map": (known(ids=(3, 3)), "prior", 1, "id 3 occurs twice"),
    "a map at infinity": (known(xy=((0, 1), (2, INF))), "prior", 1, "the map's y is inf"),
    "a map of two sizes": (known(ids=(3, 8, 9)), "prior", 0, "do not fit its 3 ids"),
    "an indefinite map": (known(cov=np.diag([1.0, 1, 1, -2])), "prior", 0, "smallest eigenvalue is -2, its largest 1"),
    "a time that is NaN": (put("t", 3, NAN), "odometry", 3, "t is nan, expected a finite number"),
    "a time that stands": (lambda p: put("t", 3, p["t"][2])(p), "odometry", 3, "expected later than"),
    "a time that goes back": (put("t", 1, -9.0), "odometry", 1, "t is -9.0, expected later than"),
    "an infinite motion": (put("delta", (2, 0), -INF), "odometry", 2, "dx is -inf"),
    "a turn that is NaN": (put("delta", (5, 2), NAN), "odometry", 5, "dtheta is nan"),
    "a turn beyond pi": (put("delta", (5, 2), 3.2), "odometry", 5, "dtheta is 3.2, expected radians from -pi to pi"),
    "a motion without noise": (put("delta_cov", 4, 0.0), "odometry", 4, "not positive definite: its smallest"),
    "noise of rank one": (put("delta_cov", 4, SINGULAR), "odometry", 4, "its largest 14"),
    "indefinite noise": (put("delta_cov", 1, np.diag([1.0, -0.5, 1])), "odometry", 1, "smallest eigenvalue is -0.5"),
    "noise that is NaN": (put("delta_cov", (1, 2, 1), NAN), "odometry", 1, "not finite"),
    "uneven noise": (put("delta_cov", (1, 2, 1), 7.0), "odometry", 1, "not symmetric"),
    "a negative range": (put("z", (1, 0), -2.5), "sightings", 1, "range is -2.5, expected more than 0"),
    "no range": (put("z", (1, 0), 0.0), "sightings", 1, "range is 0.0, expected more than 0"),
    "a bearing that is NaN": (put("z", (4, 1), NAN), "sightings", 4, "bearing is nan"),
    "a bearing in degrees": (put("z", (4, 1), -45.0), "sightings", 4, "bearing is -45.0, expected radians"),
    "an id below -1": (put("ids", 2, -2), "sightings", 2, "id is -2, expected 0 to 9007199254740992, or -1"),
    "an id that a spreadsheet would round": (put("ids", 2, 2**53 + 2), "sightings", 2, "id is 9007199254740994,"),
    "an id twice in a step": (put("ids", 4, 3), "sightings", 4, "id 3 occurs twice in step 2, expected once"),
    "sightings without noise": (put("z_cov", 3, 0.0), "sightings", 3, "smallest eigenvalue is 0"),
    "a sighting after the end": (put("sighting_step", 5, 6), "sightings", 0, "expected 0 to 5"),
    "a sighting before the start": (put("sighting_step", 0, -1), "sightings", 0, "expected 0 to 5"),
    "too few measurements": (lambda p: p.update(z=p["z"][:5]), "sightings", 0, "z has shape (5, 2), expected (6, 2)"),
    "odometry short of a row": (lambda p: p.update(delta=p["delta"][:5]), "odometry", 0, "(5, 3), expected (6, 3)"),
    "a loop to its own step": (put("loop_to", 0, 3), "loops", 0, "to is 3, expected a step from 0 to before its own"),
    "a loop to before the start": (put("loop_to", 1, -1), "loops", 1, "to is -1"),
    "a loop to infinity": (put("loop_delta", (1, 1), INF), "loops", 1, "dy is inf"),
    "a loop that winds": (put("loop_delta", (1, 2), 7.0), "loops", 1, "dtheta is 7.0"),
    "a loop without noise": (put("loop_cov", 0, 0.0), "loops", 0, "not positive definite"),
}


@pytest.mark.parametrize(("change", "table", "row", "words"), BAD.values(), ids=BAD.keys())
def test_every_fault_is_found_and_named(change: Change, table: str, row: int, words: str):
    log = small_log(change=change)
    (problem,) = problems(log)
    assert (problem.table, problem.row) == (table, row)
    assert words in problem.message
    assert refusal(check, log, where="the log") == f"the log: {table} row {row}: {problem.message}."


def test_a_log_needs_a_step():
    none, prior = np.zeros(0, np.int64), Prior(np.zeros(3), np.eye(3))
    empty = Log.from_arrays(
        "empty", prior, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)), none, none, np.zeros((0, 2)),
        np.zeros((0, 2, 2)),
    )  # fmt: skip
    refused("found no steps", check, empty, where="empty")


def test_every_bad_row_is_reported_in_order():
    changes = put("z", (1, 0), 0.0), put("t", 3, NAN), put("ids", 4, 3)
    log = small_log(change=lambda parts: [change(parts) for change in changes])
    assert [(p.table, p.row) for p in problems(log)] == [("odometry", 3), ("sightings", 1), ("sightings", 4)]


def test_unknown_sightings_may_repeat():
    assert list(problems(small_log(change=put("ids", 5, -1)))) == []


def test_asymmetry_of_rounding_is_none():
    rng = np.random.default_rng(2)
    cov = positive_definite(rng, 6, 3)
    cov[:, 0, 1] *= 1 + 1e-14
    log = dataclasses.replace(small_log(), delta_cov=cov)
    assert list(problems(log)) == []


@pytest.mark.parametrize("k", [2, 3])
def test_definiteness_agrees_with_the_eigenvalues(k: int):
    rng = np.random.default_rng(3)
    root = rng.normal(size=(400, k, k))
    cov = root @ root.swapaxes(1, 2) - 0.2 * np.eye(k)
    cov = (cov + cov.swapaxes(1, 2)) / 2
    parts = {"z_cov": cov, "ids": np.arange(400), "z": np.ones((400, 2)), "sighting_step": np.zeros(400, int)}
    if k == 3:
        parts = {"loop_cov": cov, "loop_to": np.zeros(400, int), "loop_step": np.full(400, 5)}
        parts["loop_delta"] = np.ones((400, 3))
    found = {p.row for p in problems(small_log(change=lambda columns: columns.update(parts)))}
    assert found == set(np.flatnonzero(np.linalg.eigvalsh(cov)[:, 0] <= 0).tolist())
    assert 0 < len(found) < 400


def test_definiteness_does_not_depend_on_units():
    scale = np.diag([1e-9, 1.0, 1e6])

    def change(parts: dict[str, Any]) -> None:
        parts["delta_cov"] = scale @ parts["delta_cov"] @ scale

    assert list(problems(small_log(change=change))) == []


T, POSES = small_log().t[:3], np.zeros((3, 3))
IDS, XY = np.array([3, 8]), np.zeros((2, 2))

BAD_TRUTH: dict[str, tuple[dict[str, Any], str]] = {
    "poses for other times": ({"poses": POSES[:2]}, r"poses has shape \(2, 3\), expected \(3, 3\)"),
    "poses that are a list": ({"poses": POSES.tolist()}, "poses is list, expected an array"),
    "poses of words": ({"poses": POSES.astype(str)}, "poses has entries of type"),
    "a pose that is NaN": ({"poses": POSES + np.array([0, NAN, 0])}, r"row 0: the pose is \[0.0, nan, 0.0\]"),
    "times that are no steps": ({"t": T + 1e-3}, "row 0: t is .*, expected only times of the log's steps"),
    "a time twice": ({"t": T[[0, 1, 1]]}, "row 2: t is .*, expected later than"),
    "another kind": ({"kind": "bogus"}, "kind is 'bogus', expected 'truth', 'reference' or 'relations'"),
    "other places": ({"places": "bogus"}, "places is 'bogus'"),
    "too few assigned": ({"assigned": np.array([3])}, r"assigned has shape \(1,\), expected \(6,\)"),
    "assigned fractions": ({"assigned": np.zeros(6)}, "assigned has entries of type float64, expected whole numbers"),
    "an assigned id below -1": ({"assigned": np.full(6, -2)}, "assigned row 0: found -2"),
    "one id twice in the map": ({"map": Map(IDS[[0, 0]], XY, None)}, "map row 1: the map's id 3 occurs twice"),
    "a map of two sizes": ({"map": Map(IDS, XY[:1], None)}, r"map.xy has shape \(1, 2\)"),
    "a map at infinity": ({"map": Map(IDS, XY + INF, None)}, "map row 0: the map's x is inf"),
}


@pytest.mark.parametrize("case", BAD_TRUTH)
def test_a_bad_truth_is_refused_by_its_own_name(case: str, tmp_path: Path):
    fields, sentence = BAD_TRUTH[case]
    good = Truth(T, POSES, Map(IDS, XY, None), np.array([3, 8, UNKNOWN, 3, 8, 12]), "truth")
    check_truth(small_log(), good, where="small")
    for given in (
        lambda truth: check_truth(small_log(), truth, where="log small"),
        lambda truth: log_folder.write(tmp_path / "log", small_log(), truth),
    ):
        refused(f"^log small: truth: {sentence}", given, good._replace(**fields))
    assert not list(tmp_path.iterdir())
