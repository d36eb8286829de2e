"""Errors of single landmarks: as the map's error is measured, the worst first, in a table and a small figure."""

from pathlib import Path

import numpy as np
import pytest

from csv_rows import csv_rows
from slamduel import run
from slamduel.bench.drawing.table import Table
from slamduel.bench.record.store import Store
from slamduel.bench.report.drawn_log import DrawnLog, drawn_log
from slamduel.bench.report.landmark_errors import ALL, LandmarkErrors, landmark_errors, landmark_table
from slamduel.bench.report.landmark_figures import NAMED, landmark_panels
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.styles import looks

WORLD = "bailey"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run") / "out"
    run(WORLD, ["dead-reckoning", "ekf", "smoother"], seeds=1, out=out)
    return out


@pytest.fixture(scope="module")
def drawn(folder: Path) -> DrawnLog:
    with Store(folder) as store:
        found = lines(list(store.cells()), None)
        names = looks(line.backend for line in found)
        log = drawn_log(store, found, names, {line.backend: line.backend for line in found})
    assert log is not None
    return log


@pytest.fixture(scope="module")
def errors(drawn: DrawnLog) -> LandmarkErrors:
    found = landmark_errors(drawn)
    assert found is not None
    return found


def text(table: Table, row: int) -> list[str]:
    return [entry.text for entry in table.rows[row].entries]


def test_their_root_mean_square_is_the_error_of_the_map(folder: Path, errors: LandmarkErrors) -> None:
    cells = {row["backend"]: row for row in csv_rows(folder / "cells.csv")}
    assert [one.trace.label for one in errors.maps] == ["smoother", "ekf"]  # the best first; dead reckoning has no map
    for one, sizes in zip(errors.maps, errors.sizes, strict=True):
        column = "final_map_rmse_m" if one.which == "final" else "map_rmse_m"
        assert np.sqrt(np.nanmean(sizes**2)) == pytest.approx(float(cells[one.trace.label][column]), rel=1e-12)


def test_the_table_has_the_worst_first_and_how_often_they_are_sighted(errors: LandmarkErrors) -> None:
    table = landmark_table(errors)
    assert table.of == "landmark"
    assert [column.heading for column in table.headings][:3] == ["sighted", "smoother", "ekf"]
    assert table.rows[0].backend == ALL
    assert len(table.rows) == 11
    typical = [np.median([e.value or 0.0 for e in row.entries[1:3]]) for row in table.rows[1:]]
    assert typical == sorted(typical, reverse=True)
    assert errors.times is not None
    k = list(errors.ids).index(int(table.rows[1].backend))
    assert text(table, 1)[0] == f"{errors.times[k]:,}"
    assert f"the worst 10 of {len(errors.ids)}" in table.caption


def test_a_known_landmark_that_is_on_no_map_is_counted(errors: LandmarkErrors) -> None:
    assert "on no map" not in landmark_table(errors).caption
    more = errors._replace(
        ids=np.append(errors.ids, 999),
        xy=np.append(errors.xy, [[1.0, 1.0]], axis=0),
        times=None,
        maps=[one._replace(xy=np.append(one.xy, [[np.nan, np.nan]], axis=0)) for one in errors.maps],
    )
    assert landmark_table(more).caption.endswith("; 1 known landmark is on no map")
    assert landmark_table(more).headings[0].heading == "smoother"  # earlier records do not count sightings


def test_places_that_are_exchanged_are_seen_in_the_table(errors: LandmarkErrors) -> None:
    xy = errors.xy.copy()
    xy[[3, 7]] = xy[[7, 3]]
    table = landmark_table(errors._replace(xy=xy))
    assert {row.backend: row.entries[-1].text for row in table.rows[1:3]} == {
        str(errors.ids[3]): f"that of {errors.ids[7]}",
        str(errors.ids[7]): f"that of {errors.ids[3]}",
    }
    assert {row.entries[-1].text for row in table.rows[3:]} == {"its own"}


def test_a_panel_names_the_worst_and_says_by_how_much_its_lines_are_longer(errors: LandmarkErrors) -> None:
    smoother, ekf = landmark_panels("name", errors)
    assert (smoother.title, ekf.title) == ("smoother", "ekf")
    assert "times as long as the errors" in smoother.caption
    worst = errors.ids[np.argsort(-errors.sizes[0])][:NAMED]
    assert all(f">{one}<" in smoother.svg for one in worst.tolist())


def test_a_place_far_from_all_others_is_outside_the_frame(errors: LandmarkErrors) -> None:
    xy = errors.xy.copy()
    xy[2] += 1_000
    panel = next(landmark_panels("name", errors._replace(xy=xy)))
    assert f"Outside: {errors.ids[2]}." in panel.caption


def test_a_map_of_a_thousand_landmarks_is_a_small_picture(errors: LandmarkErrors) -> None:
    rng, n = np.random.default_rng(0), 1_000
    xy = rng.uniform(0, 100, (n, 2))
    many = errors._replace(
        ids=np.arange(n),
        xy=xy,
        times=np.ones(n, np.int64),
        maps=[one._replace(xy=xy + rng.normal(0, 0.1, (n, 2))) for one in errors.maps],
    )
    assert all(len(panel.svg) < 50_000 for panel in landmark_panels("name", many))
    assert len(landmark_table(many).rows) == 11


def test_the_page_has_both(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Where the map is wrong" in page
    assert list((folder / "figures").glob("*-landmarks-*.svg"))
    assert "### Where the map is wrong" in (folder / "report.md").read_text(encoding="utf-8")
