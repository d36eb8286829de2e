"""`bench run --map M --start unknown`: the robot is found on the map, and its rows say how soon."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pages
import slamduel
from csv_rows import csv_rows
from lost_logs import RING, surveyed, unnamed
from slamduel.bench.cli import main
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Log, Map, Truth
from slamduel.core.factors.check import problems
from slamduel.datasets import archive
from slamduel.datasets.formats import log_folder
from small_log import small_dataset

COLUMNS = ("located_share", "wrong_fix_share", "locate_steps", "locate_ms")


def ring() -> tuple[Log, Truth, Map]:
    log, truth = slamduel.load(RING)
    assert truth is not None
    assert truth.map is not None
    return log.head(60), truth._replace(t=truth.t[:60], poses=truth.poses[:60], assigned=None), surveyed(truth.map)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, the same one without ids, and the landmarks with and without covariance."""
    folder = tmp_path_factory.mktemp("world")
    log, truth, known = ring()
    log_folder.write(folder / "log", log, truth)
    log_folder.write(folder / "unnamed", unnamed(log), truth)
    rows = [f"{i},{x!r},{y!r}" for i, (x, y) in zip(known.ids.tolist(), known.xy.tolist(), strict=True)]
    (folder / "exact.csv").write_text("\n".join(("id,x,y", *rows)) + "\n")
    rows = [f"{row},1e-4,0,1e-4" for row in rows]
    (folder / "map.csv").write_text("\n".join(("id,x,y,cxx,cxy,cyy", *rows)) + "\n")
    return folder


def run(world: Path, out: Path, *words: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        pages.left_out(patch)
        return main(["run", "--quiet", "--seeds", "1", "--out", str(out), *words])


def rows_of(out: Path) -> list[dict[str, Any]]:
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    for name in ("cells.csv", "metrics.csv"):
        for row in csv_rows(out / name):
            key = tuple(row[part] for part in ("dataset", "backend", "seed"))
            found[key] = {**found.get(key, {}), **row}
    return list(found.values())


def test_every_backend_is_found_on_the_map(world: Path, tmp_path: Path) -> None:
    words = ("--backend", "ekf,smoother,mcl[particles=2000]", "--dataset", str(world / "log"))
    assert run(world, tmp_path / "run", *words, "--map", str(world / "map.csv"), "--start", "unknown") == 0
    rows = rows_of(tmp_path / "run")
    assert len(rows) == 3
    for row in rows:
        assert row["status"] == "done"
        assert float(row["located_share"]) > 0.8
        assert float(row["wrong_fix_share"]) == 0
        assert float(row["ate_m"]) < 0.3
        assert int(row["locate_steps"]) >= 1
        assert float(row["locate_ms"]) > 0


def test_from_a_known_start_the_columns_are_blank(world: Path, tmp_path: Path) -> None:
    words = ("--backend", "ekf", "--dataset", str(world / "log"), "--map", str(world / "map.csv"))
    assert run(world, tmp_path / "run", *words) == 0
    (row,) = rows_of(tmp_path / "run")
    assert all(row[name] == "" for name in COLUMNS)


def test_a_log_without_ids_is_enough_for_a_backend_that_needs_none(world: Path, tmp_path: Path) -> None:
    words = ("--backend", "mcl", "--dataset", str(world / "unnamed"), "--map", str(world / "map.csv"))
    assert run(world, tmp_path / "run", *words, "--start", "unknown") == 0
    (row,) = rows_of(tmp_path / "run")
    assert float(row["located_share"]) > 0.5
    assert float(row["wrong_fix_share"]) < 0.5


def test_a_map_that_is_said_to_be_exact_needs_no_covariance(world: Path, tmp_path: Path) -> None:
    words = ("--backend", "ekf", "--dataset", str(world / "log"), "--map", str(world / "exact.csv"), "--map-fixed")
    assert run(world, tmp_path / "run", *words, "--start", "unknown") == 0
    (row,) = rows_of(tmp_path / "run")
    assert row["status"] == "done"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--start", "unknown"), "--start unknown: there is no map to find it on, expected --map beside it."),
        (
            ("--start", "unknown", "--map", "exact.csv"),
            "has no covariance, expected one with; --map-fixed says that it is exact.",
        ),
    ],
)
def test_what_cannot_be_is_a_sentence(
    words: tuple[str, ...], sentence: str, world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(world / word) if word.endswith(".csv") else word for word in words]
    assert run(world, tmp_path / "run", "--backend", "ekf", "--dataset", str(world / "log"), *given) == 2
    assert sentence in capsys.readouterr().err


def test_a_start_that_there_is_none_of_is_a_sentence(world: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"start: found 'lost', expected one of known, unknown\."):
        slamduel.run(str(world / "log"), "ekf", map=world / "map.csv", start="lost", out=tmp_path / "run")


def test_a_run_is_not_continued_from_another_start(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--backend", "ekf", "--dataset", str(world / "log"), "--map", str(world / "map.csv"))
    assert run(world, tmp_path / "run", *words) == 0
    assert run(world, tmp_path / "run", *words, "--start", "unknown") == 2
    assert "start" in capsys.readouterr().err


def test_a_path_from_the_fix_on_is_reported_and_written_beside_one_of_the_whole_log(tmp_path: Path) -> None:
    """One backend is located later than the other, so that their paths are judged at other steps of one truth."""
    dataset = "circle[steps=60,landmarks=80,map=surveyed,start=unknown]"
    assert run(tmp_path, tmp_path / "run", "--backend", "ekf,mcl", "--dataset", dataset) == 0
    rows = {row["backend"]: row for row in rows_of(tmp_path / "run")}
    assert {row["status"] for row in rows.values()} == {"done"}
    assert float(rows["ekf"]["located_share"]) < 1
    assert main(["report", str(tmp_path / "run")]) == 0
    assert "Traceback" not in (tmp_path / "run" / "report.md").read_text()


def test_mcl_without_a_map_is_skipped_with_a_sentence(world: Path, tmp_path: Path) -> None:
    assert run(world, tmp_path / "run", "--backend", "ekf,mcl", "--dataset", str(world / "log")) == 0
    (row,) = (row for row in rows_of(tmp_path / "run") if row["backend"] == "mcl")
    assert row["status"] == "skipped"
    assert (
        row["reason"]
        == "mcl localises on a given map: it needs bench run --map, or a log on one, such as circle[map=surveyed]"
    )


def test_a_log_keeps_its_unknown_start_in_an_archive_and_a_folder(tmp_path: Path) -> None:
    log, truth, known = ring()
    lost = replace(log, prior=log.prior._replace(map=known, start="unknown"))
    assert archive.unpacked(archive.packed(Dataset(lost, truth))).log.prior.start == "unknown"
    log_folder.write(tmp_path / "lost", lost, truth)
    back = log_folder.read(tmp_path / "lost").log
    assert back.prior.start == "unknown"
    assert back.digest == lost.digest


def test_an_unknown_start_is_another_log_and_a_known_one_the_same_as_ever() -> None:
    log = small_dataset().log
    assert log.digest == replace(log, prior=log.prior._replace(start="known")).digest
    assert log.digest != replace(log, prior=log.prior._replace(start="unknown")).digest


def test_an_unknown_start_without_a_map_is_no_log() -> None:
    log = small_dataset().log
    (problem,) = problems(replace(log, prior=log.prior._replace(map=None, start="unknown")))
    assert problem.message == "start is unknown without a map, expected a map to find it on"


def test_an_unknown_start_pose_costs_nothing() -> None:
    from slamduel.bench.measure.misfit import misfit

    log, truth, known = ring()
    far = log.prior._replace(pose=np.array((100.0, 0.0, 0.0)), map=known, start="unknown")
    found = misfit(replace(log, prior=far), truth.poses, known)
    assert found.prior == 0
