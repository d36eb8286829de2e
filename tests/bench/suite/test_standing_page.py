"""The page of results is made from the runs: its numbers and marks are the verdict's, and what is missing is said."""

import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import pages
from csv_rows import csv_rows
from judged_rows import told
from refusals import refused_at
from slamduel.bench.cli import main
from slamduel.bench.record.schema import Row
from slamduel.bench.suite.cost_panels import COSTS, cost_panels
from slamduel.bench.suite.history import keep, summarise
from slamduel.bench.suite.matrix import MOST, matrix, written
from slamduel.bench.suite.overview import MADE, NOT_RUN, SKIPPED, Overview, Score, overview
from slamduel.bench.suite.page import files, tables_of, write_page
from slamduel.bench.suite.pictures import pictures
from slamduel.bench.suite.results import results
from slamduel.bench.suite.site_folder import suites
from slamduel.bench.suite.tables import read_overview
from slamduel.bench.verdict.consistency import belief_word
from slamduel.bench.verdict.ranking import by_purpose, standing
from slamduel.bench.verdict.summary import lines, typical
from svg_texts import texts

TEXT = """
title = "Small"
question = "Does it stand?"
backend = ["dead-reckoning", "ekf", "ekf[gate=0.9]", "fixed-lag", "smoother"]
seeds = 9
[[run]]
name = "report"
dataset = "matlab-report[tags=12]"
[[run]]
name = "absent"
dataset = "dlr"
"""

NAN = math.nan
SCORE = Score("s", "r", "d", "d", "online", "ekf", 0, "open", 1.0, NAN, NAN, NAN, NAN, NAN, NAN, "", 5.0, 1, 9, 9)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of one small suite, on a machine without published logs."""
    return pages.site_of(tmp_path_factory.mktemp("made"), TEXT)


@pytest.fixture(scope="module")
def found(made: Path) -> Overview:
    return overview(results(made, []))


@pytest.fixture
def page(made: Path, tmp_path: Path) -> Path:
    """The site's page."""
    assert main(["suite", "--standing", str(tmp_path / "page.md"), "--out", str(made)]) == 0
    return tmp_path / "page.md"


@pytest.mark.parametrize(("purpose", "column"), [("online", "ate_m"), ("final", "final_ate_m")])
def test_marks_are_those_of_the_verdicts_pairs(made: Path, found: Overview, purpose: str, column: str) -> None:
    ((one,),) = [one.found for one in results(made, [])]
    pairs = {(c.first, c.second): c for c in one.verdict.comparisons[column]}
    online = {score.backend: score for score in found.backends if score.purpose == purpose}
    (best,) = [name for name, score in online.items() if score.standing == "best"]
    for name, score in online.items():
        if name == best:
            continue
        c = pairs[best, name]
        assert (score.standing == "worse") == (standing(c) == "better")
        assert score.times == pytest.approx(c.ratio, rel=1e-5)
        assert score.adjusted == pytest.approx(c.adjusted, rel=1e-5)
    assert {score.standing for score in online.values()} >= {"best", "worse"}


def test_the_picture_shows_numbers_asterisks_and_words_of_the_verdict(made: Path, found: Overview) -> None:
    ((one,),) = [one.found for one in results(made, [])]
    drawn = matrix("online", found.backends, "online")
    assert drawn is not None
    online = [score for score in found.backends if score.purpose == "online"]
    shown = texts(drawn.svg)
    assert [text for text in shown if text in map(written, online)]
    assert shown.count("*") == sum(score.standing in ("worse", "better") for score in online) + 1  # the legend's
    for score in online:
        (line,) = [line for line in one.lines if line.backend == score.backend]
        assert score.consistency == belief_word(line)
        assert score.error_m == pytest.approx(typical(line, "ate_m").value, rel=1e-5)
    (use,) = [use for use in one.verdict.uses if use.purpose == "online"]
    assert [score.backend for score in online if score.named] == [use.backend]


def test_the_tables_read_back_as_they_were(found: Overview, page: Path) -> None:
    read = read_overview(tables_of(page))
    for name in Overview._fields:
        kept, again = getattr(found, name), getattr(read, name)
        assert len(kept) == len(again)
        for one, other in zip(kept, again, strict=True):
            for a, b in zip(one, other, strict=True):
                both = isinstance(a, float) and math.isnan(a) and math.isnan(b)
                assert both or a == b or name == "runs", (name, one, other)  # commands name the site
    assert len(read.backends) == 5 + 2


def test_the_page_and_its_pictures_are_made_of_the_tables_alone(page: Path) -> None:
    for path, text in files(page).items():
        assert path.read_text(encoding="utf-8") == text
    assert {path.name for path in files(page)} == {
        "page.md", "online.svg", "online-cost.svg", "afterwards.svg", "afterwards-cost.svg",
    }  # fmt: skip
    (page.with_suffix("") / "backends.csv").write_text("suite\nquick\n")
    refused_at(page.with_suffix("") / "backends.csv", "is no table with suite, run", files, page)


def test_the_page_begins_with_pictures_and_has_every_name_with_its_numbers(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Results of the benchmark\n\n![Online: ")
    for row in csv_rows(page.with_suffix(".csv")):
        assert f"**{row['backend']}** {row['error']} ({row['ends']})" in text
    assert "'matlab-report[tags=12]' --seeds 9\n" in text
    for link in re.findall(r"\]\(([\w/.-]+)\)", text):
        assert (page.parent / link).is_file(), link


def test_what_is_missing_is_said_with_the_command_that_brings_it(page: Path, found: Overview) -> None:
    text = page.read_text(encoding="utf-8")
    assert "Small: dlr is not on this machine: bench fetch dlr gets it" in text
    assert "**Real robots**: not run yet, `bench suite real`." in text
    assert str(made) not in text
    states = {(one.suite, one.run): one.state for one in found.runs}
    assert states["small", "report"] == MADE
    assert states["small", "absent"] == SKIPPED
    assert states["quick", ""] == states["programs", ""] == NOT_RUN


def test_the_page_says_version_day_machine_logs_and_load(page: Path, found: Overview) -> None:
    (run,) = [one for one in found.runs if one.state == MADE]
    (row,) = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| `bench suite small")]
    assert run.version in row
    assert f"{run.processor}, {run.cores} core" in row
    assert "| 9 logs, 1 dataset | one cell at a time" in row
    assert (run.cells, run.planned, run.failed) == (45, 45, 0)


def test_a_run_that_was_stopped_is_said_to_go_on(found: Overview, page: Path) -> None:
    path = page.with_suffix("") / "runs.csv"
    (run,) = [one for one in found.runs if one.state == MADE]
    path.write_text(path.read_text().replace(",45,0,45,", ",40,0,45,"))
    assert "Small, report: 40 of 45 cells, `bench suite small" in files(page)[page]
    assert run.planned == 45


def halved(row: Row) -> Row:
    """A cell of a version whose online paths had half the error."""
    error = row.columns["ate_m"]
    return Row({**row.columns, "ate_m": error and error / 2}, "")


def test_the_page_has_what_changed_since_the_version_before(made: Path, tmp_path: Path) -> None:
    site = shutil.copytree(made, tmp_path / "site")
    now = summarise(suites(site)["small"])
    assert now is not None
    runs = {name: (facts, [halved(row) for row in rows]) for name, (facts, rows) in now.runs.items()}
    keep(site, replace(now, version="0.0.9", date="2020-01-01", revision="", runs=runs))
    write_page(site, tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "after 0.0.9 of 1 January 2020. Since 0.0.9 of 1 January 2020: " in text
    row = r"\| small, `matlab-report\[tags=12\]` \| `ekf` \| [^|]+, m \| 0\.0\.9: [\d.]+ → [^|]+ \| "
    assert re.search(row + r"\*\*worse\*\*, (2\.00 times|\+100 %)", text)


def test_the_index_has_the_pictures(made: Path) -> None:
    text = (made / "index.html").read_text(encoding="utf-8")
    for figure in pictures(overview(results(made, []))):
        assert f'aria-label="{figure.title}"' in text
        assert (made / "figures" / f"{figure.name}.svg").is_file()
    assert len(csv_rows(made / "data" / "backends.csv")) == 7


@pytest.mark.parametrize(
    ("times", "kind", "said"),
    [
        (1.0, "best", "1"), (1.0, "open", "1.00"), (1.345, "worse", "1.34"), (2.31, "worse", "2.3"),
        (9.96, "open", "10"), (17.4, "worse", "17"), (1234.0, "worse", "1k"),
        (math.inf, "failed", "\N{INFINITY}"), (NAN, "few", ""),
    ],
)  # fmt: skip
def test_the_number_of_a_cell(times: float, kind: str, said: str) -> None:
    assert written(SCORE._replace(times=times, standing=kind)) == said


def test_many_datasets_break_into_bands_after_whole_suites() -> None:
    scores = [
        SCORE._replace(suite=suite, dataset=f"{suite}{k}", backend=backend)
        for suite in ("one", "two", "three")
        for k in range(MOST // 2)
        for backend in ("ekf", "smoother" if suite == "three" else "ukf")
    ]
    drawn = matrix("online", scores, "online")
    assert drawn is not None
    shown = texts(drawn.svg)
    assert shown.count("ekf") == 2  # bands, each with the backends that are in it
    assert shown.count("smoother") == shown.count("ukf") == 1


def test_a_dataset_that_two_runs_have_is_a_column_of_each() -> None:
    """Named by its run, where that has no other dataset; the backends of one are not held against the other's."""
    scores = [
        SCORE._replace(run=run, dataset=dataset, name=dataset, backend=backend, times=times, standing=kind)
        for run, dataset, backend, times, kind in (
            ("all", "room", "ekf", 1.0, "best"),
            ("all", "hall", "ekf", 1.0, "best"),
            ("two", "room", "ekf", 1.7, "open"),
            ("two", "room", "ukf", 1.0, "best"),
        )
    ]
    drawn = matrix("online", scores, "online")
    assert drawn is not None
    shown = texts(drawn.svg)
    assert {"room (all)", "hall", "two", "1.70"} <= set(shown)
    assert "room" not in shown


def test_maps_are_compared_by_the_column_that_the_verdict_goes_by() -> None:
    def judged(**of_b: Any) -> dict[str, str]:
        one = told("a", "reference", map_rmse_m=[0.2] * 8, final_map_rmse_m=[0.1] * 8, surveyed=[1] * 8)
        other = told("b", "reference", map_rmse_m=[0.3] * 8, surveyed=[1] * 8, **of_b)
        return {purpose: column for purpose, (column, _) in by_purpose(lines(one + other)).items()}

    assert judged() == {"map": "map_rmse_m"}  # b has no final one
    assert judged(final_map_rmse_m=[0.2] * 8) == {"map": "final_map_rmse_m"}


@pytest.mark.parametrize("purpose", [*COSTS])
def test_without_a_score_there_is_no_picture(purpose: str) -> None:
    assert matrix("name", [], purpose) is None
    assert cost_panels("name", [], purpose) is None
    assert cost_panels("name", [SCORE._replace(purpose=purpose)], purpose) is None


def test_a_backend_that_failed_is_named_beside_its_panel() -> None:
    scores = [SCORE, SCORE._replace(backend="ukf"), SCORE._replace(backend="isam2", times=math.inf, standing="failed")]
    drawn = cost_panels("cost", scores, "online")
    assert drawn is not None
    shown = texts(drawn.svg)
    assert "failing: isam2" in shown
    assert "s: r" in shown
    assert {"ekf", "ukf"} <= set(shown)


def test_a_page_that_cannot_be_written_is_refused(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    for name, why in (("page.html", "found no .md at its end"), ("file/page.md", "expected a place to write to")):
        assert main(["suite", "--standing", str(tmp_path / name), "--out", str(made)]) == 2
        assert why in capsys.readouterr().err
    assert main(["suite", "small", "--standing", "page.md"]) == 2
    assert "--standing: found small beside it" in capsys.readouterr().err
