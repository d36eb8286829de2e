"""Somebody's results: what is as it was measured holds; whatever was changed, in a file or in the record, is found."""

import contextlib
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slamduel.bench.cli import main
from slamduel.bench.engine.log_files import LogFiles
from slamduel.bench.measure.cell import Result
from slamduel.bench.record.schema import FILE, packed, unpacked
from slamduel.bench.record.store import Store
from slamduel.bench.verify.again import TOLERANCE, compared, drawn
from slamduel.bench.verify.files import check_files
from slamduel.bench.verify.folder import CheckedCell, read
from slamduel.bench.verify.logs import check_logs
from slamduel.bench.verify.scores import check_scores, scores
from slamduel.bench.verify.verification import Verification, verify
from slamduel.bench.workers.executor import Here
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset
from slamduel.datasets import archive
from small_record import record
from small_run import go

DATASET = "circle[steps=50]"
CELL = "circle-1f9fa4e6/0/ekf"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two backends on two logs, as it was left."""
    folder = tmp_path_factory.mktemp("results") / "theirs"
    go(folder, "ekf,smoother", DATASET)
    return folder


@pytest.fixture
def theirs(results: Path, tmp_path: Path) -> Path:
    """A copy of it that may be changed."""
    return shutil.copytree(results, tmp_path / "theirs")


def checked(folder: Path, sample: int | None = 1, seed: int = 0) -> Verification:
    with contextlib.closing(Here()) as executor:
        return verify(folder, executor, sample=sample, seed=seed)


def faults(found: Verification) -> list[str]:
    return [f"{one.subject}: {one.sentence}" for one in found.findings if one.verdict == "fails"]


def test_what_was_measured_holds(results: Path) -> None:
    found = checked(results, sample=None)
    assert faults(found) == []
    assert {one.subject for one in found.findings} == {"files", "logs", "scores", "cells"}
    assert {one.verdict for one in found.findings} == {"holds"}
    assert found.sentence.startswith("Verified")
    assert set(found.again) == {"ekf", "smoother"}
    assert "4 cells" in found.sentence


def rewritten(name: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    """The lines of a file changed."""

    def rewrite(folder: Path) -> None:
        before = (folder / name).read_text().splitlines()
        after = change(list(before))
        assert after != before
        (folder / name).write_text("".join(f"{line}\n" for line in after))

    return rewrite


def closer(lines: list[str]) -> list[str]:
    """Another first decimal number in the first row."""
    number = next(word for word in lines[1].split(",") if "." in word and word.replace(".", "").isdigit())
    return [lines[0], lines[1].replace(number, "0.00001", 1), *lines[2:]]


def further_along(lines: list[str]) -> list[str]:
    words = lines[7].split()
    return [*lines[:7], " ".join([words[0], repr(float(words[1]) + 1e-4), *words[2:]]), *lines[8:]]


def without(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def damaged(folder: Path) -> None:
    content = bytearray((folder / FILE).read_bytes())
    content[100:4000] = bytes(3900)
    (folder / FILE).write_bytes(content)


def updated(*statements: str) -> Callable[[Path], None]:
    def update(folder: Path) -> None:
        with record(folder) as db:
            for statement in statements:
                db.execute(statement)

    return update


DIGEST = "SET digest = replace(digest, substr(digest, 1, 8), 'abcdabcd') WHERE seed = 0"
ONE, TWO = f"{DATASET}, seed 0", f"{DATASET}, seed 1"
edit_path = rewritten(f"{CELL}/online.tum", further_along)
edit_cells = rewritten("cells.csv", closer)
CHANGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a cell": (edit_cells, "files: cells.csv, line 2: ate_m is 0.00001, the record has"),
    "a pose": (edit_path, f"files: {CELL}/online.tum, line 8: found"),
    "a shorter path": (
        rewritten(f"{CELL}/online.tum", lambda rows: rows[:-1]),
        f"files: {CELL}/online.tum: has 50 lines, the record 51.",
    ),
    "no path": (without(f"{CELL}/online.tum"), f"files: {CELL}/online.tum is missing."),
    "no table": (without("metrics.csv"), "files: metrics.csv is missing."),
    "no facts": (without("run.json"), "files: run.json is missing."),
    "no record": (without(FILE), f"files: {FILE} is missing"),
    "a row less": (rewritten("cells.csv", lambda rows: rows[:-1]), "files: cells.csv: has 4 lines, the record 5."),
    "a column more": (
        rewritten("cells.csv", lambda rows: [f"{line},1" for line in rows]),
        "files: cells.csv, line 1: found ",
    ),
    "a fact": (
        rewritten("run.json", lambda rows: [line.replace('"processor": "', '"processor": "fast ') for line in rows]),
        "files: run.json, line ",
    ),
    "broken facts": (rewritten("run.json", lambda _: ["{"]), "files: run.json: has 1 line, the record "),
    "a damaged record": (damaged, "files: "),
    "a better score": (
        updated("UPDATE results SET ate_m = ate_m / 2 WHERE backend = 'ekf' AND seed = 0"),
        f"scores: {ONE}, ekf: ate_m is",
    ),
    "a better NEES": (
        updated("UPDATE results SET nees = 1 WHERE backend = 'ekf' AND seed = 1"),
        f"scores: {TWO}, ekf: nees is 1, its path gives",
    ),
    "another digest": (
        updated(f"UPDATE logs {DIGEST}", f"UPDATE results {DIGEST}"),
        f"logs: {ONE}: its digest is abcd",
    ),
    "a cell's digest": (
        updated("UPDATE results SET digest = 'abcd' WHERE backend = 'ekf' AND seed = 0"),
        f"logs: {ONE}: the digest of {ONE}, ekf is not that of its log",
    ),
    "another truth": (
        updated("UPDATE logs SET truth_digest = 'abcd' WHERE seed = 1"),
        f"logs: {TWO}: its truth has the digest abcd, made here",
    ),
}


def better_path(folder: Path) -> None:
    """A path of somebody's dreams, with all scores that belong to it: only running the backend shows it."""
    with contextlib.closing(Here()) as executor:
        trusted = check_logs(read(folder), executor, 60, lambda _: None)[1]
    with record(folder) as db:
        for key, seed in db.execute("SELECT key, seed FROM results WHERE backend = 'ekf'").fetchall():
            log = trusted[f"{DATASET}, seed {seed}"]
            truth = log.dataset.truth
            (blob,) = db.execute("SELECT archive FROM arrays WHERE key = ?", (key,)).fetchone()
            dreamt = truth.poses + 1e-3 * np.sin(np.arange(len(truth.t)))[:, None]
            arrays = unpacked(blob) | {"online": dreamt, "aligned": dreamt}
            db.execute("UPDATE arrays SET archive = ? WHERE key = ?", (packed(arrays), key))
            for name, value in scores(log, {"online": (truth.t, dreamt)}, arrays).items():
                db.execute(f"UPDATE results SET {name} = ? WHERE key = ?", (value, key))


CHANGES["a better path"] = (better_path, "cells: circle[steps=50], seed ")


@pytest.mark.parametrize("name", CHANGES)
def test_what_was_changed_is_found_and_named(theirs: Path, name: str) -> None:
    change, said = CHANGES[name]
    change(theirs)
    found = checked(theirs, sample=None)
    assert found.failed
    assert not found.sentence.startswith("Verified")
    assert any(one.startswith(said) for one in faults(found)), faults(found)


def test_other_checks_go_on_where_one_fails(theirs: Path) -> None:
    edit_cells(theirs)
    subjects = {one.subject: one.verdict for one in checked(theirs).findings}
    assert subjects == {"files": "fails", "logs": "holds", "scores": "holds", "cells": "holds"}


def test_numbers_that_differ_by_rounding_are_the_same(theirs: Path) -> None:
    path = theirs / CELL / "steps.csv"
    lines = path.read_text().splitlines()
    words = lines[5].split(",")
    place = next(k for k, word in enumerate(words) if k > 1 and len(word) > 12)
    words[place] = repr(float(words[place]) * (1 + 1e-14))
    path.write_text("\n".join([*lines[:5], ",".join(words), *lines[6:]]) + "\n")
    assert [one.verdict for one in check_files(theirs)] == ["holds"]


def test_a_backend_that_is_not_here_leaves_digests_and_scores(theirs: Path) -> None:
    with record(theirs) as db:
        for table in ("plan", "results"):
            db.execute(f"UPDATE {table} SET backend = 'elsewhere:build' WHERE backend = 'ekf'")
        (folders,) = db.execute("SELECT value FROM about WHERE name = 'folders'").fetchone()
        db.execute(
            "UPDATE about SET value = ? WHERE name = 'folders'", (folders.replace('"ekf":', '"elsewhere:build":'),)
        )
    found = checked(theirs, sample=None)
    assert faults(found) == []
    assert not found.sentence.startswith("Verified")
    assert "no cell of elsewhere:build was run again" in found.sentence
    (said,) = [one.sentence for one in found.findings if one.verdict == "not checked"]
    assert said.startswith("elsewhere:build: not run again (backend elsewhere:build cannot be imported")
    assert any(one.subject == "scores" and "of 4 cells" in one.sentence for one in found.findings)


def test_a_log_that_cannot_be_made_here_is_said_to_be_unchecked(theirs: Path) -> None:
    with record(theirs) as db:
        for table in ("plan", "results", "logs"):
            db.execute(f"UPDATE {table} SET dataset = 'log', dataset_options = 'path=/nowhere/at/all'")
        (folders,) = db.execute("SELECT value FROM about WHERE name = 'folders'").fetchone()
        new = folders.replace(f'"{DATASET}"', '"log[path=/nowhere/at/all]"')
        db.execute("UPDATE about SET value = ? WHERE name = 'folders'", (new,))
    found = checked(theirs)
    assert not found.failed
    assert not found.sentence.startswith("Verified")
    verdicts = {one.subject: one.verdict for one in found.findings}
    assert verdicts == {"files": "holds", "logs": "not checked", "scores": "not checked", "cells": "not checked"}


def moved(folder: Path, size: float) -> str:
    """Gives the log of seed 0 other sightings, off by so many m and rad, in the record and in the copy beside it.

    Returns the log's new digest.
    """
    with Store(folder) as store:
        (old,) = [known for name, known in store.logs_made().items() if name[2] == 0]
    before = LogFiles(folder).read("circle", old[0])
    after = Dataset(replace(before.log, z=before.log.z + size), before.truth)
    known = old[0]._replace(digest=after.log.digest)
    LogFiles(folder).keep("circle", known, archive.packed(after))
    with record(folder) as db:
        for table in ("logs", "results"):
            db.execute(f"UPDATE {table} SET digest = ? WHERE seed = 0", (known.digest,))
    return known.digest


@pytest.mark.parametrize(
    ("size", "portable", "verdict"),
    [
        (1e-13, False, ""),
        (1e-13, True, "its digest is"),
        (0.1, False, "standard deviations from the log made here, expected 0.1 at most"),
    ],
)
def test_a_log_may_differ_by_rounding_where_it_is_not_the_same_on_every_machine(
    theirs: Path, size: float, portable: bool, verdict: str
) -> None:
    moved(theirs, size)
    found = read(theirs)
    cells: list[CheckedCell] = []
    for cell in found.cells:
        source = replace(cell.log.dataset.source, portable=portable)
        cells.append(cell._replace(log=cell.log._replace(dataset=replace(cell.log.dataset, source=source))))
    with contextlib.closing(Here()) as executor:
        findings, trusted = check_logs(found._replace(cells=tuple(cells)), executor, 60, lambda _: None)
    wrong = [one.sentence for one in findings if one.verdict == "fails"]
    assert [verdict in said for said in wrong] == [True] * bool(verdict)
    assert len(trusted) == 2 - bool(verdict)
    assert any("The same but for rounding" in one.sentence for one in findings) == (not verdict)
    if not verdict:  # cells run on the copy
        kept = trusted[f"{DATASET}, seed 0"].kept
        assert kept.path.is_file()


def test_what_is_no_folder_of_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing: is no folder; expected the folder that bench run left"):
        checked(tmp_path / "nothing")
    with pytest.raises(InputError, match=r"holds no results; expected the folder that bench run left"):
        checked(tmp_path)


def test_the_sample_has_every_backend_and_is_the_same_for_a_seed(results: Path) -> None:
    found = read(results)
    with contextlib.closing(Here()) as executor:
        trusted = check_logs(found, executor, 60, lambda _: None)[1]
    chosen = [drawn(found, trusted, 2, np.random.default_rng(seed)) for seed in (5, 5, 6, 7, 8)]
    assert all({cell.backend_label for cell in cells} == {"ekf", "smoother"} for cells in chosen)
    assert list(map(str, chosen[0])) == list(map(str, chosen[1]))
    assert len({tuple(map(str, cells)) for cells in chosen}) > 1
    assert len(drawn(found, trusted, 99, np.random.default_rng(0))) == 4
    assert len(check_scores(found, {})) == 1


def test_a_second_run_may_differ_by_the_tolerance_and_no_more() -> None:
    row = {"ate_m": 0.1, "nees": 1.0}
    near = Result("done", "", {"ate_m": 0.1 * (1 + TOLERANCE / 2), "nees": 1.0})
    far = Result("done", "", {"ate_m": 0.1 * (1 + 2 * TOLERANCE), "nees": 1.0})
    assert compared(row, near, TOLERANCE)[0] == []
    assert compared(row, near, TOLERANCE)[1][0] == "ate_m"
    assert compared(row, far, TOLERANCE)[0] == ["ate_m is 0.1, run again 0.1002"]
    assert compared(row, Result("done", "", {"ate_m": 0.1}), TOLERANCE)[0] == ["nees is 1, run again None"]
    assert compared(row, Result("error", "broke"), TOLERANCE)[0] == ["ended as done, here as error: broke"]


def test_the_command_says_what_it_found_and_ends_accordingly(theirs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["suite", "--verify", str(theirs), "--executor", "here", "--sample", "1", "--seed", "3"]
    assert main(words) == 0
    assert "drawn with --seed 3" in capsys.readouterr().out
    edit_path(theirs)
    assert main(words) == 1
    assert re.search(r"Not verified: \d+ faults found\.", capsys.readouterr().out)
    assert main(["suite", "--verify", str(theirs / "no")]) == 2
    assert "expected the folder that bench run left" in capsys.readouterr().err
