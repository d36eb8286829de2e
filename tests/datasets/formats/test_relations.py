"""Relations beside a laser log: read, placed at the steps, kept in every form of a log, and what cannot be used."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from carmen_files import written
from driven import final
from refusals import refusal, refused
from slamduel import run
from slamduel.bench.measure.relations import relation_columns
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Truth
from slamduel.core.relations import as_rows
from slamduel.core.se2 import between
from slamduel.datasets import archive
from slamduel.datasets.formats import log_folder
from slamduel.datasets.truth import digest
from slamduel.datasets.worlds import laser_floor


def related(path: Path, truth: Truth, rows: list[tuple[float, float]] | None = None) -> Path:
    """Writes true relations between scans 10 apart, or between the times `rows`."""
    pairs = rows or [(float(a), float(b)) for a, b in zip(truth.t, truth.t[10:], strict=False)]
    lines = list[str]()
    for first, second in pairs:
        at = [np.array([np.interp(t, truth.t, column) for column in truth.poses.T]) for t in (first, second)]
        x, y, turn = between(*at)
        lines.append(f"{first:.6f} {second:.6f} {x:.6f} {y:.6f} 0 0 0 {turn:.6f}")
    path.write_text("\n".join([*lines, ""]))
    return path


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Truth]:
    """A CARMEN log, and its true path."""
    recording, truth = laser_floor.record(laser_floor.Options(laps=0.15, people=0), np.random.default_rng(0))
    return written(tmp_path_factory.mktemp("drive") / "floor.clf", recording), truth


def beside(drive: tuple[Path, Truth], folder: Path, rows: list[tuple[float, float]] | None = None) -> Path:
    path = folder / "floor.clf.gz"
    path.write_bytes(gzip.compress(drive[0].read_bytes()))
    related(folder / "floor.relations", drive[1], rows)
    return path


def test_true_relations_of_the_drive_are_met(drive: tuple[Path, Truth], tmp_path: Path) -> None:
    log, truth = load(str(beside(drive, tmp_path)))
    assert truth.kind == "relations"
    assert truth.relations is not None
    assert truth.relations.exact.all()
    assert len(truth.relations.delta) == len(drive[1].t) - 10
    found = final("graph", log)
    row = relation_columns(truth.relations, found.path)
    assert row["relation_m"] < 0.02
    assert row["relation_deg"] < 0.3
    worse = relation_columns(truth.relations, found.path * np.array((1.05, 1.05, 1.0)))
    assert worse["relation_m"] > row["relation_m"] + 0.01


def test_they_survive_folder_and_archive(drive: tuple[Path, Truth], tmp_path: Path) -> None:
    log, truth = load(str(beside(drive, tmp_path)))
    assert truth is not None
    assert truth.relations is not None
    log_folder.write(tmp_path / "log", log, truth)
    for again in (log_folder.read(tmp_path / "log"), archive.unpacked(archive.packed(Dataset(log, truth)))):
        assert again.truth is not None
        assert again.truth.relations is not None
        assert again.truth.kind == "relations"
        assert (as_rows(again.truth.relations) == as_rows(truth.relations)).all()
        assert digest(again.truth) == digest(truth)
    file = tmp_path / "log" / "relations.csv"
    lines = file.read_text().splitlines()
    cells = lines[3].split(",")
    cells[0] = "999"
    file.write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:], ""]))
    refused(r"relations\.csv: relations row 2: found step 999, expected 0 to", log_folder.read, tmp_path / "log")
    cells[0], cells[7] = "1", "1.5"
    file.write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:], ""]))
    refused(r"relations\.csv, line 4: first_share is 1\.5, expected 0 to 1", log_folder.read, tmp_path / "log")


def test_stamps_between_scans_count_and_those_outside_do_not(drive: tuple[Path, Truth], tmp_path: Path) -> None:
    t = drive[1].t
    rows = [(float(t[3]), float(t[30])), (float(t[4]) + 0.07, float(t[31])), (float(t[5]), float(t[-1]) + 9)]
    log, truth = load(str(beside(drive, tmp_path, rows)))
    assert truth.relations.exact.tolist() == [True, False]
    assert any("1 of 3 relations are left out" in remark for remark in log.remarks)


def test_a_run_ranks_by_them(drive: tuple[Path, Truth], tmp_path: Path) -> None:
    path = beside(drive, tmp_path)
    found = run([str(path)], ["dead-reckoning", "graph"], out=tmp_path / "run")
    cells = {row["backend"]: row for row in found.cells}
    assert cells["graph"]["truth_kind"] == "relations"
    assert cells["graph"]["ate_m"] is None
    assert cells["graph"]["final_relation_m"] < 0.02
    final = cells["graph"]["final_relation_m"]
    assert cells["dead-reckoning"]["relation_m"] == pytest.approx(final, rel=1e-6)  # no loop corrects the motions
    assert cells["graph"]["relations"] == cells["graph"]["relations_exact"] == len(drive[1].t) - 10
    page = (tmp_path / "run" / "report.html").read_text()
    assert "true motions between" in page


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("0.2 0.4 1 2 0 0 0", "line 2: found 7 columns, expected 8"),
        ("0.2 0.2 1 2 0 0 0 0.1", "line 2: t1 and t2 are both 0.2, expected two scans"),
        ("0.2 0.4 nan 2 0 0 0 0.1", "line 2: x is nan, expected a finite number"),
        ("0.2 0.4 1 2 0 0 0 east", "line 2: yaw is 'east', expected a number"),
    ],
)
def test_what_cannot_be_used_is_named(drive: tuple[Path, Truth], tmp_path: Path, line: str, said: str) -> None:
    path = beside(drive, tmp_path)
    file = tmp_path / "floor.relations"
    lines = file.read_text().splitlines()
    file.write_text("\n".join([lines[0], line, *lines[1:], ""]))
    assert said in refusal(load, str(path))


def test_relations_of_another_log_are_refused(drive: tuple[Path, Truth], tmp_path: Path) -> None:
    path = beside(drive, tmp_path)
    (tmp_path / "floor.relations").write_text("976052905.1 976052911.8 1 2 0 0 0 0.5\n")
    refused(r"found 1 relations, all at times from 976052905\.1.* without scans", load, str(path))


def test_a_kept_log_is_made_anew_where_its_files_have_changed(drive: tuple[Path, Truth], tmp_path: Path) -> None:
    path = beside(drive, tmp_path)
    (tmp_path / "floor.relations").unlink()
    _, without = load(str(path))
    assert without is None or without.kind == "reference"
    related(tmp_path / "floor.relations", drive[1])
    _, found = load(str(path))
    assert found.kind == "relations"
    shorter = gzip.decompress(path.read_bytes()).splitlines(keepends=True)[:-100]
    before, _ = load(str(path))
    path.write_bytes(gzip.compress(b"".join(shorter)))
    after, _ = load(str(path))
    assert len(after) < len(before)
