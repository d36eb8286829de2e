"""The report: one page that needs nothing else, says what the record says, and never more."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from html_page import Page
from narrow_window import fits, would_be_seen
from slamduel.bench.record.schema import COLUMNS, MORE
from slamduel.bench.report.drawn_log import DrawnLog, Trace
from slamduel.bench.report.path_figures import trajectories
from slamduel.bench.report.report import write_report
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.columns import COLUMNS as DEFINED
from slamduel.bench.words.numerals import number
from slamduel.bench.words.styles import Look, looks
from small_record import STEPS, Record
from tiers import first_quick

EVIL = "<script>alert('a')</script> & | `b` [c](d) $e$"

WHOSE = {"ekf": "compiled here", "isam2": "GTSAM's wheel", "graph": "GTSAM's wheel", EVIL: EVIL}
"""Whose programs backends are; of the others the record does not say it."""

ODD = "no reading for 5 s, from 20 to 25 s"


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Record]:
    """Two datasets, one of them with a reference only; every way a cell can end."""
    made = Record(tmp_path_factory.mktemp("run") / "r")
    made.store.put_about({"implementations": WHOSE})
    for seed in range(3):
        made.cell("room", "truth", "ekf", seed=seed, off=0.1, ate_m=0.1 + 0.01 * seed, step_us_p50=1234.4 + seed)
        made.cell("room", "truth", "isam2", seed=seed, off=0.2, paths=("online", "final"), alone=seed > 0)
        made.failed("room", "truth", "late", "timeout", f"after {seed} s", seed=seed)
    made.cell("room", "truth", "dead-reckoning", off=40.0, leave_out=("map_ids", "map_xy", "map_cov"))
    made.cell("room", "truth", "fastslam", "particles=10", off=0.3, nees=9.0, nees_inside=0.2)
    made.cell("room", "truth", "graph", paths=("final",))
    made.failed("room", "truth", EVIL, "error", EVIL, f"Traceback:\n  {EVIL}")
    made.failed("room", "truth", "wild", "diverged", "step 3: the pose is not finite")
    made.failed("room", "truth", "none", "skipped", "the log has loop closures")
    made.cell("park", "reference", "ekf", off=3.0)
    made.cell("park", "reference", "isam2", paths=("online", "final"))
    with made.store.together() as db:
        db.execute("UPDATE logs SET remarks = ? WHERE dataset = 'room' AND seed = 0", (json.dumps([ODD, EVIL]),))
    write_report(made.store)
    yield made
    made.store.close()


@pytest.fixture(scope="module")
def text(record: Record) -> str:
    return (record.store.folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


@pytest.fixture(scope="module")
def markdown(record: Record) -> str:
    return (record.store.folder / "report.md").read_text(encoding="utf-8")


def section(record: Record, page: Page, dataset: str) -> str:
    return page.sections[record.store.run()["folders"][dataset]]


def test_the_page_needs_nothing_but_itself(page: Page, text: str) -> None:
    tags = {tag for tag, _ in page.elements}
    assert not tags & {"link", "img", "iframe", "object"}
    scripts = [attrs for tag, attrs in page.elements if tag == "script"]
    assert scripts.count({}) == 1  # the page's own, which its policy names by its digest
    assert all(attrs in ({}, {"type": "application/json"}) for attrs in scripts)
    (policy,) = [attrs["content"] or "" for _, attrs in page.elements if "http-equiv" in attrs]
    (own,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert base64.b64encode(hashlib.sha256(own.encode()).digest()).decode() in policy
    assert "default-src 'none'" in policy
    targets = [value or "" for _, attrs in page.elements for name, value in attrs.items() if name in ("src", "href")]
    assert len(targets) > 20
    assert not [target for target in targets if "//" in target or ":" in target]
    assert set(re.findall(r"url\(([^)])", text)) == {"#"}
    assert "@import" not in text


def test_marks_within_the_page_lead_to_one_element_each(page: Page) -> None:
    ids = [attrs["id"] for _, attrs in page.elements if "id" in attrs]
    assert len(ids) == len(set(ids))
    targets = {value for _, attrs in page.elements if (value := attrs.get("href") or "").startswith("#")}
    assert targets
    assert {target[1:] for target in targets} <= set(ids)


def test_links_lead_to_what_export_writes(record: Record, page: Page) -> None:
    folders = record.store.run()["folders"]
    wanted = {
        f"{folders[line.dataset]}/{row.columns['seed']}/{folders[line.backend]}/"
        for line in lines(record.store.cells())
        for row in line.rows
        if row.columns["status"] == "done"
    }
    found = {attrs.get("href") or "" for _, attrs in page.elements}
    assert wanted == {target for target in found if target.endswith("/")} - {"figures/", "tables/"}
    assert {"cells.csv", "run.json", "report.md"} <= found


def test_a_reference_is_never_called_truth(record: Record, page: Page, markdown: str) -> None:
    park = section(record, page, "park")
    assert "truth" not in re.sub("(no|without) ground truth", "", park.lower())
    assert "no verdict on accuracy" in park
    assert "by construction" in park
    assert "from reference" in park
    assert "closest" not in park
    assert "NEES" not in park
    part = markdown.partition("## park")[2].partition("\n## ")[0]
    assert "by construction" in part
    assert "truth" not in re.sub("([Nn]o|[Ww]ithout) ground truth", "", part)
    assert "**0" not in part


def test_the_verdict_is_what_the_record_says(record: Record, page: Page) -> None:
    room = section(record, page, "room")
    assert "3 logs are too few to test" in room
    assert "ekf 0.110 m" in room
    assert "isam2*" in room
    assert "3 timeout" in room


def test_tables_hold_the_records_numbers(record: Record, page: Page, markdown: str) -> None:
    for line in lines(record.store.cells()):
        shown = section(record, page, line.dataset)
        for name in ("ate_m", "final_ate_m", "map_rmse_m", "cost_j", "step_us_p50", "step_us_p99", "cpu_s", "peak_mb"):
            if name in line.values:
                assert number(line.values[name].median) in shown, (line.backend, name)
                assert number(line.values[name].median) in markdown
    assert "1,235" in section(record, page, "room")


def test_tables_in_markdown_are_tables(markdown: str) -> None:
    """A line of dashes below each heading, nothing between, and as many columns in every row."""
    tables = re.findall(r"(?:^\|.*\n)+", markdown, re.MULTILINE)
    assert len(tables) > 4
    for lines_ in (found.splitlines() for found in tables):
        assert re.fullmatch(r"(\| :?---:? )+\|", lines_[1])
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines_}) == 1


def test_times_beside_others_are_marked(record: Record, page: Page, markdown: str) -> None:
    (isam2,) = [ln for ln in lines(record.store.cells()) if (ln.dataset, ln.backend) == ("room", "isam2")]
    marked = number(isam2.values["step_us_p99"].median)
    assert f"{marked}*" in section(record, page, "room")
    assert f"{marked}\\*" in markdown
    assert "1,235*" not in section(record, page, "room")
    assert "*" not in section(record, page, "park")


def test_failures_are_told_and_escaped(record: Record, page: Page, text: str, markdown: str) -> None:
    room = section(record, page, "room")
    assert "<script>alert" not in text
    assert html.escape(EVIL, quote=False) in text.replace("&#39;", "'")
    assert room.count(EVIL) >= 4  # name, reason, traceback, not drawn
    assert "<script" not in markdown
    assert r"\| \`b\` \[c\](d) \$e\$" in markdown
    for reason in ("after 0 s", "after 2 s", "step 3: the pose is not finite", "the log has loop closures"):
        assert reason in room
        assert reason in markdown


def test_remarks_stand_below_the_datasets_heading(record: Record, page: Page, text: str, markdown: str) -> None:
    room, park = (section(record, page, name) for name in ("room", "park"))
    assert f"remark  seed 0: {ODD}" in room
    assert f"- **remark** seed 0: {ODD}" in markdown
    assert room.index(ODD) < room.index("ATE")
    assert f"seed 0: {html.escape(EVIL, quote=False)}" in text.replace("&#39;", "'")
    assert "remark" not in park.partition("ATE")[0]


def test_whose_programs_are_compared_is_told_with_the_costs(record: Record, page: Page, markdown: str) -> None:
    room, park = (" ".join(section(record, page, name).split()) for name in ("room", "park"))
    caution = "Costs compare implementations, not algorithms alone."
    assert f"Compiled here: ekf; GTSAM's wheel: the others. {caution}" in room
    assert f"GTSAM's wheel: isam2; compiled here: ekf. {caution}" in park
    assert "Ringed: GTSAM's wheel; the others are compiled here." in room
    assert markdown.count(caution) == 2


def test_repeating_is_told(page: Page, markdown: str) -> None:
    rest = page.sections[""]
    for told in ("--out 'a <b>'", "With a stop watch", "abacus & sons", "d0" * 32, "d2" * 32, "particles = 10"):
        assert told in rest
    assert "--out 'a <b>'" in markdown


def test_every_column_is_defined(page: Page) -> None:
    assert {*COLUMNS, *MORE} < {*DEFINED}
    for column in DEFINED.values():
        assert column.meaning in page.sections[""]


def test_every_figure_is_there(record: Record, page: Page, markdown: str) -> None:
    named = re.findall(r"!\[.*\]\((.*?)\)", markdown)
    files = sorted(record.store.folder.glob("figures/*"))
    assert sorted(record.store.folder / name for name in named) == files
    paths = {"room": 5, "park": 2}
    along = {"room": ("error", "pareto", "cost", "cost-along", "seeds"), "park": ("error", "cost", "cost-along")}
    folders = record.store.run()["folders"]
    for dataset, panels in paths.items():
        slug = folders[dataset]
        assert len([f for f in files if f.name.startswith(f"{slug}-trajectory-")]) == panels
        assert {f"{slug}-{name}.svg" for name in along[dataset]} <= {f.name for f in files}
    assert sum(tag == "figure" for tag, _ in page.elements) == len(files)
    for file in files:
        assert ElementTree.parse(file).getroot().tag.endswith("svg")
        assert not re.search("#0[1-9]0[1-9]0[1-9]", file.read_text(encoding="utf-8"))  # no stand-in colour is left


def test_writing_again_changes_nothing(record: Record) -> None:
    folder = record.store.folder
    files = [f for f in folder.rglob("*") if f.suffix in (".html", ".md", ".svg")]
    before = {f: f.read_bytes() for f in files}
    write_report(record.store)
    assert {f: f.read_bytes() for f in files} == before
    assert not list(folder.rglob(".*"))


def test_dead_reckoning_does_not_stretch_the_frame() -> None:
    t = np.linspace(0, 6, 200)
    path = np.column_stack((3 * np.cos(t), 3 * np.sin(t), t))
    lost = path * (1000, 1000, 1)
    for known in ({"t": t, "poses": path}, {}):
        traces = [
            Trace(name, name, look, True, {"t": t, "online": p, **({"aligned": p} if known else {})})
            for (name, look), p in zip(looks(["ekf", "dead-reckoning"]).items(), (path, lost), strict=True)
        ]
        panels = list(trajectories("x", DrawnLog("truth" if known else "", 0, known, traces, (), {})))
        assert [panel.title for panel in panels] == ["ekf", "dead-reckoning"]
        for panel in panels:
            marks = [float(m.replace("\u2212", "-")) for m in re.findall(r">([\u2212\d.]+)</text>", panel.svg)]
            assert len(marks) > 4
            assert max(map(abs, marks)) <= 4
        assert [bool(panel.caption) for panel in panels] == [False, True]


def test_j_is_told_by_its_parts_and_particles_and_gates_where_there_are_any(tmp_path: Path) -> None:
    made = Record(tmp_path / "r")
    inside: dict[str, dict[str, Any]] = {
        "plain": {},
        "particles": {"n_eff_least": 40.0, "ancestors_left": 11},
        "gated": {"refused_share": 1 / 7},
    }
    for backend, more in inside.items():
        paths = ("online", "final") if backend == "plain" else ("online",)
        cost_j = {"plain": 2000.0, "particles": 3000.0, "gated": 4000.0}[backend]
        made.cell("room", "truth", backend, paths=paths, cost_j=cost_j, **more)
    write_report(made.store)
    made.store.close()
    text = (tmp_path / "r" / "report.md").read_text(encoding="utf-8")
    tables = [[line for line in part.splitlines() if line.startswith("|")] for part in text.split("\n\n")]
    fit, inner = (next(t for t in tables if t and word in t[0]) for word in ("J, final path", "ancestors left"))
    assert fit[0] == "| backend | done | prior | odometry | sightings | J, final path | J, online path |"
    assert "| plain | 1/1 | 200 | 400 | 1,400 | **2,000** |  |" in fit
    assert "| gated | 1/1 | 400 | 800 | 2,800 |  | 4,000 |" in fit
    assert inner[0] == "| backend | done | fewest effective particles | ancestors left | refused |"
    assert sorted(inner[2:]) == ["| gated | 1/1 |  |  | 14.3 % |", "| particles | 1/1 | 40.0 | 11 |  |"]
    assert f"True noise would give about {3 * (STEPS - 1)} of odometry and 14.0 of sightings at the true" in text
    assert "a filter's J is large by nature" in text


def test_looks_are_told_apart() -> None:
    names = [f"backend-{k}" for k in range(20)]
    chosen = looks(["dead-reckoning", *names, "backend-3"])
    assert len(set(chosen.values())) == 21
    assert len({chosen[name].colour for name in names[:6]}) == 6
    assert isinstance(chosen["dead-reckoning"], Look)


BARE = ("cov", "step_ns", "map_ids", "map_xy", "map_cov", "nees", "aligned", "alignment", "at")


@pytest.mark.parametrize(
    "case",
    first_quick(
        ["no cells", "nothing at all", "odd names", "none done", "no truth", "one step", "bare", "seed 1", "perfect"], 3
    ),
)
def test_any_record_has_a_report(tmp_path: Path, request: pytest.FixtureRequest, case: str) -> None:
    made = Record(tmp_path / "r")
    request.addfinalizer(made.store.close)
    said = {"none done": "no cell is done", "no truth": "There is no known path", "seed 1": "Paths, seed 1"}
    if case == "none done":
        made.failed("room", "truth", "ekf", "diverged", "")
    elif case == "no truth":
        made.cell("room", "", "ekf", paths=("online", "final"))
        made.cell("room", "", "dead-reckoning", off=400.0)
    elif case == "one step":
        made.cell("room", "truth", "ekf", steps=1)
    elif case == "bare":
        made.cell("room", "truth", "ekf", leave_out=BARE)
    elif case == "nothing at all":
        unmeasured: dict[str, Any] = dict.fromkeys(COLUMNS[10:36])
        made.cell("room", "truth", "ekf", leave_out=(*BARE, "t", "online"), **unmeasured)
    elif case == "seed 1":
        made.failed("room", "truth", "ekf", "error", "no")
        made.cell("room", "truth", "ekf", seed=1)
    elif case == "odd names":
        for name in ("a/b:c \u6f22 $x_1$ & #1 %20?", "isam2" * 20, "#010203"):
            made.cell("dir/\u6f22 'x' & \"y\"", "truth", name)
    elif case == "perfect":
        made.cell("room", "truth", "ekf", off=0.0, step_us_p50=0.0)
        made.cell("room", "truth", "isam2", off=0.0)
    write_report(made.store)
    page = Page((made.store.folder / "report.html").read_text(encoding="utf-8"))
    assert said.get(case, "slamduel") in " ".join(page.sections.values())
    assert (made.store.folder / "report.md").read_text(encoding="utf-8").startswith("# slamduel report\n")


@pytest.mark.slow
def test_nothing_sticks_out_of_a_narrow_window(text: str, tmp_path: Path) -> None:
    assert fits(text, tmp_path)
    assert would_be_seen(text, tmp_path)


def test_the_record_is_of_a_log_with_times(record: Record, page: Page) -> None:
    assert "of real time" in section(record, page, "room")
    assert f"{STEPS} steps, 7 sightings, 5.90 s" in section(record, page, "room")
