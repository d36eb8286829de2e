"""A study's report says what its store has, no more; and the gallery what the reports say."""

import json
import re
import shutil
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.bench.gallery import gallery, main
from slamduel.bench.numerals import number
from slamduel.bench.statistics import estimate
from slamduel.bench.study import Figure
from slamduel.bench.study_evidence import evidence
from slamduel.bench.study_medians import MANY, medians
from slamduel.bench.study_report import write
from slamduel.bench.study_table import StudyTable
from slamduel.frontend.errors import InputError
from small_study import Outcome, small_study

TEXT = """
title = "Tags & tags"
question = "Are <b>many</b> tags better than few?"
source = "Report | one"
finding = "They are."
[[cells]]
dataset = "circle"
backend = ["ekf", "ukf"]
seeds = 8
grid."dataset.landmarks" = [6, 12, 24]
[[figure]]
x = "landmarks"
y = "ate_m"
log = "xy"
[[figure]]
x = "backend"
y = "nees"
where = { landmarks = 6 }
[[claim]]
says = "More are better"
measure = "ate_m"
less = { landmarks = 24 }
than = { landmarks = 6 }
where = { backend = "ekf" }
[[claim]]
says = "The EKF is consistent"
measure = "nees"
of = { backend = "ekf", landmarks = 6 }
below = 1.25
"""


def ate(backend: str, landmarks: int, seed: int) -> float:
    """Halves as landmarks double, spread over seeds."""
    return (1 + (backend == "ukf")) * 0.6 / landmarks * (1 + 0.01 * seed)


def outcomes(waiting: int = 0, failing: int = 0, nees: float = 1.0) -> list[Outcome]:
    """Those of all cells, the last seeds waiting; the first so many of the UKF's failed with 24 landmarks."""
    found: list[Outcome] = []
    for backend in ("ekf", "ukf"):
        for landmarks in (6, 12, 24):
            for seed in range(8):
                cell = {"dataset": "circle", "backend": backend, "seed": seed, "landmarks": landmarks}
                columns = {"ate_m": ate(backend, landmarks, seed), "nees": nees + 0.01 * seed}
                status = "waiting" if seed >= 8 - waiting else "done"
                if backend == "ukf" and landmarks == 24 and seed < failing:
                    status, columns = "diverged", {"reason": f"left at step {seed} <by far>"}
                found.append(Outcome(cell, status, columns))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_study(tmp_path_factory.mktemp("study") / "tags", "tags", TEXT, outcomes(failing=2))


@pytest.fixture(scope="module")
def page(folder: Path) -> Path:
    return write(folder, ("png",))


def said(path: Path) -> str:
    """What a reader sees of a page, in one line."""
    body = path.read_text(encoding="utf-8").partition("<body>")[2]
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", body)).split())


def test_the_page_has_the_numbers_of_the_store(page: Path) -> None:
    text = said(page)
    for backend in ("ekf", "ukf"):
        for landmarks in (6, 12, 24):
            values = [ate(backend, landmarks, seed) for seed in range(8)]
            if (backend, landmarks) == ("ukf", 24):
                values[:2] = [np.inf] * 2
            found = estimate(values)
            assert f"{number(found.value)} {number(found.low)}\N{EN DASH}{number(found.high)}, n 8" in text
    markdown = page.with_name("report.md").read_text(encoding="utf-8")
    assert number(estimate([ate("ekf", 12, seed) for seed in range(8)]).value) in markdown


def test_a_finding_that_holds_is_reproduced_and_every_claim_has_its_interval(page: Path, folder: Path) -> None:
    text, found = said(page), evidence(folder)
    assert "✓ Reproduced : all 2 claims hold" in text
    document = json.loads(page.with_name("answers.json").read_text())
    assert document["reproduced"] == "yes"
    assert document["cells"] == {"done": 46, "diverged": 2}
    for answer, written in zip(found.answers, document["claims"], strict=True):
        assert answer.sentence in text
        assert written["estimate"] == pytest.approx(answer.figures["estimate"])
        ends = f"{number(answer.figures['low'])}\N{EN DASH}{number(answer.figures['high'])}"
        assert ends in text or answer.figures["low"] == answer.figures["high"]


def test_a_finding_that_does_not_hold_says_so_plainly(tmp_path: Path) -> None:
    folder = small_study(tmp_path / "s", "s", TEXT, outcomes(nees=3.0))
    text = said(write(folder, ()))
    assert "✗ Not reproduced" in text
    assert "✓ Reproduced" not in text
    assert json.loads((folder / "answers.json").read_text())["reproduced"] == "no"


def test_failures_are_grouped_with_their_reason_and_place(page: Path) -> None:
    text = said(page)
    assert "2 of 48 cells failed" in text
    assert "diverged , 2 cells: left at step 0 <by far>" in text
    assert "backend ukf; seed 0, 1; landmarks 24" in text
    assert "46 done, 2 diverged" in text
    assert "2 of 48, counted as the worst there is" in text


def test_half_a_study_says_how_far_it_is(tmp_path: Path) -> None:
    text = said(write(small_study(tmp_path / "s", "s", TEXT, outcomes(waiting=3)), ()))
    assert "18 of 48 cells have not run" in text
    assert "? Cannot be told yet" in text
    assert "n 5, 3 waiting" in text


def test_a_study_of_which_nothing_has_run_has_a_page(tmp_path: Path) -> None:
    text = said(write(small_study(tmp_path / "s", "s", TEXT, outcomes(waiting=8)), ()))
    assert "48 of 48 cells have not run" in text
    assert "nan" not in text.lower().split()


def test_what_people_wrote_is_text(page: Path) -> None:
    html = page.read_text(encoding="utf-8")
    assert "<b>many</b>" not in html
    assert "Are &lt;b&gt;many&lt;/b&gt; tags better than few?" in html
    assert "Report \\| one" in page.with_name("report.md").read_text(encoding="utf-8")


def test_figures_are_files(page: Path) -> None:
    assert {path.name for path in (page.parent / "figures").iterdir()} == {
        f"tags-{k}.{form}" for k in (1, 2) for form in ("svg", "png")
    }


def test_no_study_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected the folder of a study"):
        write(tmp_path)


def test_a_median_keeps_its_places() -> None:
    """By x and by, each with the cells that are its own; a large group's interval is the exact one's, nearly."""
    rng = np.random.default_rng(1)
    n = 4 * (MANY + 1)
    values = rng.lognormal(size=n)
    columns: dict[str, Any] = {
        "backend": np.array(["a", "b"] * (n // 2), object),
        "noise": np.array([0.2, 0.2, 0.1, 0.1] * (n // 4), object),
        "status": np.array(["done"] * n, object),
        "ate_m": values,
    }
    found = medians(Figure("noise", "ate_m", "backend", {}, "", "", ""), StudyTable(columns))
    assert list(found.xs) == [0.1, 0.2]
    for k, key in enumerate([(0.2, "a"), (0.2, "b"), (0.1, "a"), (0.1, "b")]):
        exact, place = estimate(values[k::4].tolist()), found.places[key]
        assert place.n == MANY + 1
        assert place.value == pytest.approx(exact.value)
        own = np.sort(values[k::4])
        for end, other in ((place.low, exact.low), (place.high, exact.high)):
            assert abs(np.searchsorted(own, end) - np.searchsorted(own, other)) <= 2


def test_the_gallery_counts_findings_and_leads_to_reports(page: Path, tmp_path: Path) -> None:
    root = tmp_path / "gallery"
    shutil.copytree(page.parent, root / "tags")
    small_study(root / "wrong", "wrong", TEXT, outcomes(nees=3.0))
    assert main([str(root)]) == 0
    index = root / "index.html"
    text = said(index)
    assert "1 of 2 published findings reproduced, 1 not" in text
    assert 'href="tags/report.html"' in index.read_text(encoding="utf-8")
    assert evidence(root / "tags").answers[0].sentence in text
    (root / "broken").mkdir()
    (root / "broken" / "study.sqlite").write_text("no database")
    assert main([str(root)]) == 0
    assert "broken/study.sqlite" in said(index)


def test_a_gallery_of_nothing_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path)]) == 2
    assert "found no study" in capsys.readouterr().err


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: its package drives the browser"
    )
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        pytest.skip("chromium is not installed")
    with api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-quic"])


def test_pages_fit_are_quiet_and_ask_for_nothing(browser: Any, page: Path) -> None:
    index = gallery([page.parent], page.parent / "index.html")
    for path in (page, index):
        for width in (1400, 400):
            shown = browser.new_page(viewport={"width": width, "height": 900}, color_scheme="dark")
            heard: list[str] = []
            asked: list[str] = []
            shown.on("console", lambda message, heard=heard: heard.append(message.text))
            shown.on("request", lambda request, asked=asked: asked.append(request.url))
            shown.goto(path.as_uri())
            assert shown.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
            shown.evaluate("for (const fold of document.querySelectorAll('details')) fold.open = true")
            assert shown.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
            assert (heard, asked) == ([], [path.as_uri()])
            assert shown.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
            shown.close()
