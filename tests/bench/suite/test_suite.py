"""A suite is a list of runs; its site says what they found, what is missing, who entered, and what has changed."""

import json
import re
import shutil
import sqlite3
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

import pages
from csv_rows import csv_rows
from slamduel.bench.cli import main
from slamduel.bench.record.schema import COLUMNS, FILE, MORE, Row
from slamduel.bench.record.store import Store
from slamduel.bench.run import benchmark
from slamduel.bench.suite import file as suite_file
from slamduel.bench.suite.history import Summary, keep, since, summaries, summarise
from slamduel.bench.suite.over_versions import HIGH, over_versions, points
from slamduel.bench.suite.site import write_site
from slamduel.bench.suite.site_folder import suites
from slamduel.bench.suite.standing import COSTS, standings
from slamduel.bench.suite.submission import submissions
from slamduel.bench.verdict.summary import median, typical
from slamduel.core.errors import InputError
from small_record import edited, record
from small_run import go

TEXT = """
title = "Small & quick"
question = "Does <b>it</b> stand?"
backend = ["dead-reckoning", "ekf", "smoother"]
seeds = 6
[[run]]
name = "circle"
dataset = "circle[steps=50]"
[[run]]
name = "absent"
dataset = "dlr"
"""

DATASET = "circle[steps=50]"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of one suite, on a machine without published logs; reports of runs are left out."""
    return pages.site_of(tmp_path_factory.mktemp("made"), TEXT)


@pytest.fixture
def site(made: Path, tmp_path: Path) -> Path:
    """A copy of it that may be changed."""
    return shutil.copytree(made, tmp_path / "site")


@pytest.fixture(scope="module")
def theirs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Somebody's run of a backend on the suite's logs, with an EKF beside it."""
    folder = tmp_path_factory.mktemp("theirs") / "theirs"
    go(folder, "ekf,invariant-ekf", DATASET, seeds=6)
    return folder


@pytest.fixture(scope="module")
def joined(made: Path, theirs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site with that run entered."""
    site = shutil.copytree(made, tmp_path_factory.mktemp("joined") / "site")
    assert entered(site, theirs) == 0
    return site


@pytest.fixture
def larger(joined: Path, tmp_path: Path) -> Path:
    """A copy of that one."""
    return shutil.copytree(joined, tmp_path / "larger")


def page(path: Path) -> str:
    return unescape(re.sub(r"<[^>]+>", " ", path.read_text(encoding="utf-8")))


def entered(site: Path, theirs: Path) -> int:
    words = ["suite", "--add", str(theirs), "--out", str(site), "--executor", "here", "--sample", "2", "--quiet"]
    return main(words)


def test_each_run_is_an_ordinary_folder(made: Path) -> None:
    (folder,) = (made / "small").glob("*")
    assert {path.name for path in folder.iterdir()} == {"circle", "skipped.json", "suite.toml"}
    assert {"run.json", "cells.csv", FILE} <= {path.name for path in (folder / "circle").iterdir()}
    command = json.loads((folder / "circle/run.json").read_text())["command"]
    assert command.startswith("bench run --backend dead-reckoning,ekf,smoother --dataset 'circle[steps=50]' --seeds 6")


def test_what_has_a_result_is_not_run_again(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    pages.left_out(monkeypatch)

    def times() -> list[Any]:
        (record,) = site.glob(f"small/*/circle/{FILE}")
        return sqlite3.connect(record).execute("SELECT key, recorded FROM results ORDER BY key").fetchall()

    before = times()
    (tmp_path / "small.toml").write_text(TEXT)
    assert main(["suite", str(tmp_path / "small.toml"), "--out", str(site), "--executor", "here", "--quiet"]) == 0
    assert times() == before
    assert len(before) == 18


def test_a_log_that_is_not_here_is_skipped_with_the_command_that_gets_it(made: Path) -> None:
    for name in ("index.html", "small.html"):
        assert "absent: dlr is not on this machine: bench fetch dlr gets it" in page(made / name)


def test_a_suite_without_any_log_ends_with_status_1_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "gone.toml").write_text('backend = "ekf"\n[[run]]\nname = "dlr"\ndataset = "dlr"\n')
    words = ["suite", str(tmp_path / "gone.toml"), "--out", str(tmp_path / "site"), "--executor", "here", "--quiet"]
    assert main(words) == 1
    assert capsys.readouterr().err.startswith("bench: dlr: skipped. dlr is not on this machine")
    assert "No run of this suite has been made" in page(tmp_path / "site/index.html")


@pytest.mark.parametrize("name", ["index.html", "small.html"])
def test_every_link_leads_to_a_file_of_the_site_and_nothing_is_fetched(made: Path, name: str) -> None:
    text = (made / name).read_text(encoding="utf-8")
    links = [unquote(unescape(link)).partition("#") for link in re.findall(r'href="([^"]+)"', text)]
    assert len(links) > 6
    for way, _, anchor in links:
        if way.endswith("report.html"):  # whose writing is left out here
            continue
        assert (made / (way or name)).exists(), way
        if anchor:
            assert f'id="{anchor}"' in (made / (way or name)).read_text(encoding="utf-8"), anchor
    assert "://" not in text
    assert "<script" not in text


def test_the_page_says_who_is_best_by_how_much_at_what_cost_and_how_consistent(made: Path) -> None:
    text = re.sub(r"\s+", " ", page(made / "index.html"))
    (best,) = [row for row in csv_rows(made / "data/overview.csv") if row["purpose"] == "final"]
    assert best["backend"] == "smoother"
    assert f"{best['error']} ({best['ends']})" in text
    for said in (best["consistency"], best["cost"], best["why"]):
        assert said
        assert said in text
    assert "Does <b>it</b> stand?" in text
    assert "6 logs; the true path is known" in text


def test_the_tables_to_download_have_the_values_of_the_runs(made: Path) -> None:
    (folder,) = made.glob("small/*/circle")
    (path,) = made.glob("data/small-circle-*-ranking.csv")
    cells = csv_rows(folder / "cells.csv")
    for row in csv_rows(path):
        mine = [cell for cell in cells if cell["backend"] == row["backend"]]
        assert int(row["done"]) == int(row["logs"]) == 6
        for name in ("ate_m", "nees", "step_us_p50"):
            values = [float(cell[name]) for cell in mine]
            assert float(row[name]) == pytest.approx(median(values), rel=1e-12)
            assert min(values) <= float(row[f"{name}_low"]) <= float(row[name]) <= float(row[f"{name}_high"])
    (pairs,) = made.glob("data/small-circle-*-pairs.csv")
    assert {(row["first"], row["second"]) for row in csv_rows(pairs)} >= {("smoother", "ekf")}


def test_each_figure_and_table_names_its_command(made: Path) -> None:
    text = page(made / "small.html")
    figures = [path.name for path in (made / "figures").glob("*.svg")]
    assert {name.rpartition("-")[2] for name in figures} >= {"online.svg", "cost.svg", "off.svg"}
    assert text.count(f"bench suite small --out {made}") >= 4
    assert text.count("bench run --backend dead-reckoning,ekf,smoother --dataset 'circle[steps=50]' --seeds 6") == 2


def test_the_site_is_written_again_without_running(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (site / "index.html").unlink()
    assert main(["suite", "--site", "--out", str(site)]) == 0
    assert capsys.readouterr().out == f"site: {site / 'index.html'}\n"
    assert (site / "index.html").is_file()


def older(summary: Summary, column: str, factor: float) -> Summary:
    """The same results of an earlier version, in which a column of the EKF was `factor` times as large."""

    def before(row: Row) -> Row:
        value = row.columns[column]
        if value is None or row.columns["backend"] != "ekf":
            return row
        return Row({**row.columns, column: factor * value}, "")

    runs = {name: (facts, [before(row) for row in rows]) for name, (facts, rows) in summary.runs.items()}
    return replace(summary, version="0.0.9", date="2020-01-01", revision="", runs=runs)


def summary_of(site: Path) -> Summary:
    found = summarise(suites(site)["small"])
    assert found is not None
    return found


def test_what_is_kept_reads_back(made: Path) -> None:
    (found,) = summaries(made, "small")
    now = summary_of(made)
    assert found.name == now.name
    blank = dict.fromkeys((*COLUMNS, *MORE))
    cells = {name: [dict(row.columns) for row in rows] for name, (_, rows) in found.runs.items()}
    assert cells == {name: [blank | dict(row.columns) for row in rows] for name, (_, rows) in now.runs.items()}
    assert (made / "history/small" / f"{found.name}.json").stat().st_size < 30_000


@pytest.mark.parametrize(("factor", "verdict"), [(0.5, "regression"), (2.0, "gain"), (1.0, "the same to the last bit")])
def test_a_change_since_the_last_version_is_judged_as_bench_compare_does(
    made: Path, factor: float, verdict: str
) -> None:
    now = summary_of(made)
    changes, _ = since(older(now, "ate_m", factor), now)
    assert changes[DATASET, "ekf", "ate_m"].verdict == verdict
    assert changes[DATASET, "smoother", "ate_m"].verdict == "the same to the last bit"


def test_the_page_shows_results_over_versions(site: Path) -> None:
    for version, factor in (("0.0.8", 0.25), ("0.0.9", 0.5)):
        keep(site, replace(older(summary_of(site), "ate_m", factor), version=version))
    write_site(site)
    text = re.sub(r"\s+", " ", page(site / "small.html"))
    assert "Since 0.0.9 of 2020-01-01: 1 regression" in text
    assert re.search(r'<span class="worse">(2\.00 times|\+100 %) \(', (site / "small.html").read_text())
    assert "3 versions" in text
    medians = [row for row in csv_rows(site / "data/small-history.csv") if row["backend"] == "ekf"]
    assert [row["version"] for row in medians[:2]] == ["0.0.8", "0.0.9"]
    assert float(medians[2]["ate_m"]) == pytest.approx(2 * float(medians[1]["ate_m"]))
    shown = over_versions(summaries(site, "small"))
    assert shown.worse
    assert all(trend.points for row in shown.rows for trend in row.trends)


def test_other_logs_are_not_compared_over_versions(made: Path) -> None:
    now = summary_of(made)
    runs = {
        name: (
            {**facts, "sketches": {}},
            [Row({**row.columns, "digest": f"other {row.columns['digest']}"}, "") for row in rows],
        )
        for name, (facts, rows) in now.runs.items()
    }
    changes, notes = since(replace(now, version="0.0.9", runs=runs), now)
    assert changes == {}
    assert notes == ["circle: no cell on the same log in both versions."]


def test_a_sparkline_goes_up_with_its_values() -> None:
    heights = [float(point.split(",")[1]) for point in points([1.0, 2.0, 4.0]).split()]
    assert heights == sorted(heights, reverse=True)
    assert heights[1] == pytest.approx(HIGH / 2)
    assert points([1.0]) == points([]) == points([float("nan"), 2.0]) == ""


def test_somebodys_backend_is_ranked_and_marked(joined: Path) -> None:
    (path,) = joined.glob("data/small-circle-*-ranking.csv")
    rows = {row["backend"]: row for row in csv_rows(path)}
    assert rows["invariant-ekf"]["submitted"] == "theirs, verified"
    assert rows["ekf"]["submitted"] == ""
    assert rows["invariant-ekf"]["step_us_p50"]
    text = page(joined / "index.html")
    assert "Verified: nothing that was checked is wrong, and 2 cells run again gave the same." in text
    assert "verified" in page(joined / "small.html")


def test_whose_a_submitted_backend_is_comes_from_its_run(site: Path, theirs: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(theirs, tmp_path / "plugin")
    with record(folder) as db:
        said = json.dumps({"invariant-ekf": "their-slam 1.2"})
        db.execute("INSERT OR REPLACE INTO about VALUES ('distributions', ?)", (said,))
    assert entered(site, folder) == 0
    assert "their-slam 1.2" in page(site / "index.html")
    assert "their-slam 1.2, verified" in page(site / "small.html")


def test_what_fails_its_verification_is_not_entered(site: Path, theirs: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(theirs, tmp_path / "forged")
    (folder / "cells.csv").write_text((folder / "cells.csv").read_text().replace("done", "gone", 1))
    assert entered(site, folder) == 1
    assert not (site / "submitted").exists()


def test_what_has_changed_since_it_was_entered_is_not_verified(larger: Path) -> None:
    with record(larger / "submitted/theirs") as db:
        db.execute("UPDATE results SET ate_m = ate_m / 10 WHERE backend = 'invariant-ekf'")
    (found,) = submissions(larger)
    assert found.mark("invariant-ekf") == "not verified"
    assert "has changed since it was entered" in found.sentence


def test_costs_of_another_machine_are_not_compared(site: Path, theirs: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(theirs, tmp_path / "abroad")
    with record(folder) as db:
        (said,) = db.execute("SELECT value FROM about WHERE name = 'environment'").fetchone()
        here = json.loads(said) | {"processor": "abacus"}
        db.execute("UPDATE about SET value = ? WHERE name = 'environment'", (json.dumps(here),))
    assert entered(site, folder) == 0
    one = standing_of(site)
    assert one.elsewhere == {"invariant-ekf"}
    (line,) = [line for line in one.lines if line.backend == "invariant-ekf"]
    assert not set(line.values) & set(COSTS)
    assert typical(line, "ate_m").value > 0
    assert "Timed on another machine, so that costs are not compared: invariant-ekf." in page(site / "small.html")


def test_datasets_are_in_the_order_of_their_run(tmp_path: Path) -> None:
    names = ["circle[steps=9]", "circle[steps=30]", "aruco-robot", "circle[steps=10]"]
    go(tmp_path / "run", "dead-reckoning,ekf", ",".join(names), seeds=1)
    assert [one.dataset for one in standings("run", tmp_path / "run", [])] == names


def standing_of(site: Path) -> Any:
    (folder,) = suites(site)["small"].runs.values()
    (found,) = standings("circle", folder, submissions(site))
    return found


@pytest.mark.parametrize(("off", "logs"), [(0.0, 6), (1.0, 5)])
def test_a_log_that_differs_by_rounding_is_the_suites_and_any_other_is_left_out(
    larger: Path, off: float, logs: int
) -> None:
    with Store(larger / "submitted/theirs") as store:
        sketch = store.run()["sketches"][f"{DATASET}, seed 0"]
    sketch["sums"][0] += off
    edited(larger / "submitted/theirs", "UPDATE results SET digest = 'abcd' WHERE seed = 0")
    sql = "UPDATE logs SET digest = 'abcd', sketch = :sketch WHERE seed = 0"
    edited(larger / "submitted/theirs", sql, sketch=json.dumps(sketch))
    found = standing_of(larger)
    (line,) = [line for line in found.lines if line.backend == "invariant-ekf"]
    assert len(line.rows) == logs
    assert len({row.columns["digest"] for one in found.lines for row in one.rows}) == 6
    assert found.notes == [
        "theirs: 1 cell on other logs than this suite's are left out.",
        "theirs: invariant-ekf ran on 5 of 6 logs of this suite.",
    ] * (logs == 5)


def test_the_packaged_suites_can_be_read_and_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    names = ["quick", "simulated", "real", "camera", "laser", "speed", "programs"]
    assert suite_file.packaged() == names
    assert all(suite_file.read(name).runs for name in names)
    assert main(["suite", "--list"]) == main(["suite"]) == 0
    listed = capsys.readouterr().out
    assert {name: listed.count(f"\n{name}: ") for name in names[1:]} == dict.fromkeys(names[1:], 2)


def test_a_run_on_logs_of_their_own_has_no_seeds(tmp_path: Path) -> None:
    (tmp_path / "many.toml").write_text('backend = "ekf"\n[[run]]\nname = "all"\ndataset = "mrclam[robot=all]"\n')
    (run,) = suite_file.read(str(tmp_path / "many.toml")).runs
    assert run.command == "bench run --backend ekf --dataset 'mrclam[robot=all]'"
    assert benchmark.planned(run.given, tmp_path / "new").cells()[-1].seed == 4
    (mrclam,) = [run for run in suite_file.read("real").runs if run.name == "mrclam-all"]
    assert "seeds" not in mrclam.given


BAD = {
    'dataset = "circle"': r"bad\.toml, line 3: there is no such key; expected one of|bad\.toml, line \d+.*dataset",
    "": r"bad\.toml: the file has no 'run', expected \[\[run\]\] with a name and a dataset",
    '[[run]]\nname = "a b"\ndataset = "circle"\nbackend = "ekf"': r"line 2: run\.name: found 'a b', expected letters",
    '[[run]]\nname = "a"\ndataset = "circle"': r"has no 'backend', expected a text or a list of texts",
    '[[run]]\nname = "a"\ndataset = "cirle"\nbackend = "ekf"': r"line 3: run\.dataset: there is no dataset 'cirle'",
    '[[run]]\nname = "a"\ndataset = "circle"\nbackend = "efk"': r"line 4: run\.backend: there is no backend 'efk'",
    '[[run]]\nname = "a"\ndataset = "circle"\nbackend = "ekf"\nseeds = 0': r"line 5: run\.seeds: found 0, expected a",
    '[[run]]\nname = "a"\ndataset = "circle"\nbackend = "ekf"\n' * 2: r"line 6: run\.name: a is the name of two runs",
    "[[run]": r"bad\.toml, line 1: not valid TOML",
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_suite_file_is_refused_with_its_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(InputError, match=BAD[text]):
        suite_file.read(str(tmp_path / "bad.toml"))


def test_damaged_files_of_a_site_are_refused(larger: Path) -> None:
    for path in (larger / "submitted/theirs.json", next(larger.glob("history/small/*.json"))):
        whole = path.read_text()
        path.write_text(whole[:-20])
        with pytest.raises(InputError, match=re.escape(str(path))):
            write_site(larger)
        path.write_text(whole)
    write_site(larger)
