"""Map, then localise: what a run leaves is what another starts from, exactly, and it is worth it."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pages
from csv_rows import csv_rows
from random_logs import random_log
from slamduel.backends.api import Backend
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.backends.registry import find
from slamduel.bench.cli import main
from slamduel.bench.measure.drive import Outcome, drive
from slamduel.bench.measure.kept import JOINT_MOST
from slamduel.bench.measure.nees import nees
from slamduel.bench.measure.score import score
from slamduel.bench.plan.given_map import BLOCKS, FIXED, JOINT, GivenMap, localising, read
from slamduel.bench.plan.landmark_file import block_diagonal
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.reference import made_with_reference
from slamduel.bench.plan.spec import dataset_variants
from slamduel.bench.record.schema import FILE
from slamduel.bench.record.store import Store
from slamduel.core.errors import InputError
from slamduel.core.factors import Log, Map, Prior, Truth
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.formats import log_folder
from small_log import small_dataset
from small_record import put

HALF = 60
GAUSSIAN = ("ekf", "isam2", "graph")


def halves(seed: int, landmarks: int = 10) -> tuple[Log, Log, Truth]:
    """A log cut in two, and the truth of the second half: its start is known from elsewhere, to 10 cm and 0.05 rad."""
    rng = np.random.default_rng(seed)
    log, truth = random_log(rng, 2 * HALF, landmarks)
    cov = np.diag((0.1, 0.1, 0.05)) ** 2
    pose = truth.poses[HALF] + rng.multivariate_normal(np.zeros(3), cov)
    pose[2] = wrap(pose[2])
    second = Log.from_steps("second", Prior(pose, cov), list(log)[HALF:])
    return log.head(HALF), second, truth._replace(t=truth.t[HALF:], poses=truth.poses[HALF:])


def driven(name: str, log: Log, **options: Any) -> Outcome:
    builder = find(name)
    return drive(builder, replace(builder.options(), **options), log, lambda: np.random.default_rng(0))


def followed(name: str, log: Log) -> tuple[Array, Backend]:
    """The online path of a backend that is asked for nothing else, and the backend at its end."""
    builder = find(name)
    backend = builder.make(log.prior, builder.options(), np.random.default_rng(0))
    return np.array([backend.step(step) for step in log]), backend


def path_of(outcome: Outcome) -> Array:
    path = outcome.online if outcome.solution is None else outcome.solution.path
    assert path is not None
    return path


@pytest.fixture(scope="module")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of one world, and `mapped`, a run of two backends on the first."""
    folder = tmp_path_factory.mktemp("worlds")
    first, second, truth = halves(1)
    log_folder.write(folder / "first", first, None)
    log_folder.write(folder / "second", second, truth)
    words = ["--backend", "ekf,isam2", "--dataset", str(folder / "first"), "--out", str(folder / "mapped")]
    with pytest.MonkeyPatch.context() as patch:
        pages.left_out(patch)
        assert main(["run", "--quiet", *words]) == 0
    return folder


def cell(run: Path, backend: str, seed: int = 0) -> Path:
    (place,) = run.glob(f"*/{seed}/{backend}")
    return place


def arrays(run: Path) -> dict[str, dict[str, Any]]:
    with Store(run) as store:
        return {row.columns["backend"]: store.arrays(row) for row in store.cells()}


def test_the_record_gives_back_the_map_with_its_joint_covariance(worlds: Path) -> None:
    first = log_folder.read(worlds / "first").log
    for backend in ("ekf", "isam2"):
        given = read(str(cell(worlds / "mapped", backend)), fixed=False)
        (found,) = given.maps.values()
        made = driven(backend, first).map
        assert made.cov is not None
        assert found.cov is not None
        assert given.kinds == {JOINT}
        assert np.array_equal(found.ids, made.ids)
        assert np.array_equal(found.xy, made.xy)
        assert np.array_equal(found.cov, found.cov.T)
        assert np.allclose(found.cov, made.cov, rtol=1e-12, atol=0)
        assert np.abs(found.cov - block_diagonal(blocks(found.cov))).max() > 1e-4  # there is something to be joint


def blocks(cov: Array) -> Array:
    n = len(cov) // 2
    return cov.reshape(n, 2, n, 2)[np.arange(n), :, np.arange(n)]


def test_localisation_is_the_textbook_filter_with_that_map(worlds: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = cell(worlds / "mapped", "ekf")
    out = worlds / "localised"
    words = ["--backend", "ekf,dead-reckoning", "--dataset", str(worlds / "second"), "--map", str(source)]
    assert main(["run", "--quiet", *words, "--out", str(out)]) == 0
    log = log_folder.read(worlds / "second").log
    (known,) = read(str(source), fixed=False).maps.values()
    textbook = TextbookEkf(log.prior._replace(map=known))
    path = np.array([textbook.step(step) for step in log])
    found = arrays(out)["ekf"]
    np.testing.assert_allclose(found["online"], path, atol=1e-9)
    np.testing.assert_allclose(found["cov"][-1], textbook.cov[:3, :3], rtol=1e-6, atol=1e-12)
    assert found["map_ids"].tolist() == textbook.ids
    about = json.loads((out / "run.json").read_text())
    assert about["plan"]["map"] == str(source)
    assert len(about["plan"]["map_digest"]) == 64
    rows = csv_rows(out / "cells.csv")
    assert {row["digest"] for row in rows} == {localising(log, known, "").digest}
    assert {row["reason"] for row in rows} == {""}
    said = f"{len(known.ids)} landmarks from {source}, with its joint covariance"
    assert said in (out / "report.html").read_text()
    pages.left_out(monkeypatch)
    assert main(["run", "--quiet", "--out", str(out)]) == 0  # it goes on, with the map it has


@pytest.mark.slow
@pytest.mark.parametrize("backend", [*GAUSSIAN, "fastslam"])
def test_a_map_makes_localisation_better(backend: str) -> None:
    error = {True: 0.0, False: 0.0}
    for seed in range(3):
        first, second, truth = halves(seed)
        known = followed("ekf", first)[1].map()
        for with_map in error:
            log = localising(second, known, "second") if with_map else second
            off = (path_of(driven(backend, log)) - truth.poses)[:, :2]
            error[with_map] += float((off**2).sum(axis=1).mean())
    assert error[True] < 0.5 * error[False]


@pytest.mark.slow
def test_localising_on_a_map_of_ones_own_is_consistent_and_needs_its_joint_covariance() -> None:
    seeds = 40
    joint, alone = np.zeros((2, seeds))
    for k in range(seeds):
        first, second, truth = halves(100 + k)
        known = followed("ekf", first)[1].map()
        assert known.cov is not None
        for found, cov in ((joint, known.cov), (alone, block_diagonal(blocks(known.cov)))):
            path, backend = followed("ekf", localising(second, known._replace(cov=cov), "second"))
            belief = backend.belief()
            found[k] = nees(path[-1:], belief.cov[None], truth.poses[-1:])[0] / 3
    spread = np.sqrt(2 / (3 * seeds))  # of the mean of chi-square over its 3 degrees of freedom
    assert abs(joint.mean() - 1) < 4 * spread
    assert alone.mean() > 1 + 4 * spread


def test_landmarks_that_the_map_lacks_are_added_and_those_held_fixed_stay() -> None:
    first, second, truth = halves(3)
    known = followed("ekf", first)[1].map()
    some = Map(known.ids[:4], known.xy[:4], None)
    assert truth.map is not None
    for backend in (*GAUSSIAN, "fastslam"):
        outcome = driven(backend, localising(second, some, "second"))
        landmarks = outcome.map if outcome.solution is None else outcome.solution.map
        assert set(landmarks.ids) == set(some.ids) | set(second.ids)
        at = [landmarks.ids.tolist().index(i) for i in some.ids]
        np.testing.assert_allclose(landmarks.xy[at], some.xy, atol=1e-4)
        judged = score(second, outcome, truth)
        assert judged.row["landmarks"] == len(landmarks.ids)
        name = "map_rmse_m" if outcome.solution is None else "final_map_rmse_m"
        without = outcome.map._replace(ids=outcome.map.ids + 1_000_000)
        assert judged.row[name] > 0
        if outcome.solution is None:
            assert score(second, replace(outcome, map=without), truth).row[name] is None


def test_a_map_none_of_whose_landmarks_is_sighted_is_remarked_on() -> None:
    first, second, _ = halves(4)
    known = followed("ekf", first)[1].map()
    strange = localising(second, known._replace(ids=known.ids + 1_000_000), "second")
    said = f"none of the {len(known.ids)} landmarks of the given map is sighted"
    assert said in score(strange, driven("dead-reckoning", strange), None).remark
    good = localising(second, known, "second")
    assert score(good, driven("dead-reckoning", good), None).remark == ""


def test_of_a_very_large_map_the_blocks_alone_are_kept() -> None:
    first, _, _ = halves(5)
    outcome = driven("ekf", first)
    for n in (JOINT_MOST, JOINT_MOST + 1):
        many = Map(np.arange(n), np.zeros((n, 2)), np.eye(2 * n))
        kept = score(first, replace(outcome, map=many), None).arrays
        assert ("map_joint" in kept) == (n == JOINT_MOST)
        assert kept["map_cov"].shape == (n, 2, 2)


def test_files_of_landmarks(worlds: Path, tmp_path: Path) -> None:
    place = cell(worlds / "mapped", "ekf")
    whole = read(str(place), fixed=False).maps[0]
    assert whole.cov is not None
    alone = read(str(place / "map.csv"), fixed=False)
    assert alone.kinds == {BLOCKS}
    np.testing.assert_allclose(alone.maps[0].xy, whole.xy)
    assert alone.maps[0].cov is not None
    np.testing.assert_allclose(alone.maps[0].cov, block_diagonal(blocks(whole.cov)))
    for text in ("id,x,y\n3,1,2\n5,-1,0.5\n", "id,x,y,cxx,cxy,cyy\n3,1,2,,,\n5,-1,0.5,,,\n"):
        (tmp_path / "landmarks.csv").write_text(text)
        bare = read(str(tmp_path / "landmarks.csv"), fixed=False)
        assert bare.kinds == {FIXED}
        assert bare.maps[0].ids.tolist() == [3, 5]
        assert bare.maps[0].xy.tolist() == [[1, 2], [-1, 0.5]]
        assert bare.maps[0].cov is None
    held = read(str(place), fixed=True)
    assert held.kinds == {FIXED}
    assert held.maps[0].cov is None
    assert held.digest != read(str(place), fixed=False).digest


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("id,x\n1,2\n", "line 1: found 'id,x', expected id,x,y or id,x,y,cxx,cxy,cyy."),
        ("id,x,y\n", "there is no landmark"),
        ("id,x,y\n1,2\n", "line 2: found 2 columns, expected 3"),
        ("id,x,y\n1,2,3\n2,here,1\n", "line 3: x is 'here', expected a number"),
        ("id,x,y\n1,2,3\n2,nan,1\n", "line 3: x is nan, expected a finite number"),
        ("id,x,y\n1,2,3\n2,,1\n", "line 3: x is '', expected a number"),
        ("id,x,y\n1.5,2,3\n", "line 2: id is 1.5, expected a whole number"),
        ("id,x,y\n-1,2,3\n", "line 2: id is -1, expected 0 or more"),
        ("id,x,y\n1,2,3\n4,2,3\n1,0,0\n", "line 4: id 1 is there a second time"),
        ("id,x,y,cxx,cxy,cyy\n1,2,3,1,0,1\n2,2,3,,,\n", "line 3: cxx is nan, expected a finite number"),
        ("id,x,y,cxx,cxy,cyy\n1,2,3,1,2,1\n", "line 2: the covariance cxx,cxy,cyy is not positive definite"),
    ],
)
def test_a_bad_file_is_a_sentence_with_its_line(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(InputError, match=re.escape(f"{tmp_path / 'm.csv'}") + ".*" + re.escape(sentence)):
        read(str(tmp_path / "m.csv"), fixed=False)


def test_what_cannot_be_told_apart_or_found_is_a_sentence(worlds: Path, tmp_path: Path) -> None:
    run = worlds / "mapped"
    for place, said in (
        (run, r"holds 2 maps, expected one of: .*/ekf, .*/isam2"),
        (tmp_path / "nowhere", "there is no such place; expected the folder of a run"),
        (tmp_path, "there is no map here"),
        (cell(run, "ekf").with_name("graph"), "found no cell with a map, expected one of: "),
    ):
        with pytest.raises(InputError, match=said):
            read(str(place), fixed=False)
    own = small_dataset()
    log_folder.write(tmp_path / "own", own.log, own.truth)
    variant = dataset_variants(str(tmp_path / "own"))[0]
    with pytest.raises(InputError, match="dataset log has a map of its own in its prior"):
        made_with_reference(variant.name, variant.options, 0, own.log.prior.map)


@pytest.mark.usefixtures("no_report")
def test_another_map_into_the_same_run_is_refused(
    worlds: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    landmarks, out = tmp_path / "landmarks.csv", tmp_path / "run"
    landmarks.write_text("id,x,y\n3,1,2\n")
    words = ["run", "--backend", "dead-reckoning", "--dataset", str(worlds / "second"), "--out", str(out)]
    assert main([*words, "--map", str(landmarks)]) == 0
    capsys.readouterr()
    assert main([*words, "--map", str(cell(worlds / "mapped", "ekf"))]) == 2
    assert f"holds a run with map {landmarks}, found map" in capsys.readouterr().err
    landmarks.write_text("id,x,y\n3,1,2.5\n")
    assert main(["run", "--out", str(out)]) == 2
    assert f"--map {landmarks}: has changed since this run was begun" in capsys.readouterr().err


def test_an_older_record_has_the_covariance_of_each_landmark_alone(worlds: Path, tmp_path: Path) -> None:
    """Records were once kept without the joint covariance, and without counts of ancestors and refused sightings."""
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / FILE).write_bytes((worlds / "mapped" / FILE).read_bytes())
    with Store(tmp_path / "old", writing=True) as store:
        for row in list(store.cells()):
            lacking = ("map_joint", "final_map_joint", "ancestors", "refused", "cost_terms")
            left = {name: array for name, array in store.arrays(row).items() if name not in lacking}
            put(store, row.result, row.columns, left)
    assert main(["report", str(tmp_path / "old")]) == 0
    steps = csv_rows(cell(tmp_path / "old", "ekf") / "steps.csv")
    assert {(step["ancestors"], step["refused"]) for step in steps} == {("", "")}
    assert (tmp_path / "old" / "cost.csv").read_text().count("\n") == 1
    given = read(str(cell(tmp_path / "old", "ekf")), fixed=False)
    assert given.kinds == {BLOCKS}


def given_by_seed(seeds: tuple[int, ...], world: str) -> GivenMap:
    made: Callable[[int], Map] = lambda seed: Map(np.array([seed]), np.zeros((1, 2)), None)  # noqa: E731
    return GivenMap("results/x", False, {seed: made(seed) for seed in seeds}, frozenset({FIXED}), world)


def test_where_every_seed_is_another_world_each_gets_its_own_map() -> None:
    room, drive_, park = (
        dataset_variants(name)[0] for name in ("aruco-room", "aruco-room[speed=0.3]", "victoria-park")
    )
    words = {"backend": "ekf,fastslam", "dataset": "aruco-room", "seeds": 5, "timeout_s": 1.0, "memory_mb": 1}
    several = given_by_seed((0, 2), "aruco-room")
    plan = replace(Plan.from_words(words), map=several)
    assert {c.seed for c in plan.cells()} == {0, 2}
    assert plan.remarks() == "aruco-room: of 5 seeds, only those of the map are run: 0, 2."
    assert Plan.from_words(words).remarks() == ""
    made = replace(given_by_seed((0,), ""), made_of="victoria-park")
    both = replace(Plan.from_words(words | {"dataset": "victoria-park,circle", "seeds": 1}), map=made)
    assert both.remarks() == (
        "victoria-park: the map was made from this very log, whose sightings count twice. "
        "circle: the map is of victoria-park, and only helps in the same place."
    )
    assert [several.of(drive_, seed).ids[0] for seed in (0, 2)] == [0, 2]
    with pytest.raises(InputError, match="holds a map for each of 2 seeds of aruco-room, expected the folder of one"):
        several.seeds(park, range(3))
    one = given_by_seed((4,), "aruco-room")
    assert one.seeds(room, range(5)) == [4]
    assert one.seeds(park, range(3)) == [0, 1, 2]
    assert one.of(park, 2).ids.tolist() == [4]
    with pytest.raises(InputError, match="seed 4, whose world no other seed has; expected --seeds 5 or more"):
        one.seeds(room, range(3))
