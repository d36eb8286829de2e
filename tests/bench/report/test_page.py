"""The report's page in a browser: nothing sticks out, nothing is fetched, everyone can read it, and it answers."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from big_record import big
from slamduel.bench.report.report import write_report
from slamduel.bench.words.columns import about
from small_record import Record

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
pytestmark = pytest.mark.slow

BACKENDS = ("ekf", "fastslam", "isam2")
PLOTS = {"exclude": [["figure .plot > svg"]]}
"""What axe need not look into: hundreds of marks of axes, all in the one colour of the page's text."""

BUDGET = 5_000_000
"""Bytes, of a page on 3 backends, 5 datasets and 30 seeds."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A page with everything: two datasets, one with a reference; failures, and something that was left out."""
    made = Record(tmp_path_factory.mktemp("run") / "r")
    for seed in range(6):
        made.cell("room", "truth", "ekf", seed=seed, off=0.2, rpe_m=0.1)
        made.cell("room", "truth", "isam2", seed=seed, off=0.1, paths=("online", "final"))
        made.cell("room", "truth", "fastslam", f"particles=10,{'resample_below=0.5,' * 4}x=1", seed=seed, off=0.4)
    made.failed("room", "truth", "wild", "error", "it broke", f"Traceback:\n  {'long ' * 60}")
    made.cell("yard[path=" + "far/" * 30 + "away]", "reference", "ekf")
    write_report(made.store)
    made.store.close()
    return (made.store.folder / "report.html").as_uri()


class Seen:
    """A page that was opened, with what it said and asked for."""

    def __init__(
        self, browser: Any, address: str, width: int = 1400, *, dark: bool = False, script: bool = True
    ) -> None:
        self.page = browser.new_page(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if dark else "light",
            java_script_enabled=script,
        )
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.set_default_timeout(120_000)  # ms
        self.page.goto(address)


@pytest.fixture
def wide(browser: Any, address: str) -> Iterator[Any]:
    seen = Seen(browser, address)
    yield seen.page
    seen.page.close()
    assert seen.said == []
    assert seen.asked == [address]


def overflow(page: Any) -> int:
    return page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
def test_it_fits_is_quiet_and_everyone_can_read_it(browser: Any, address: str, width: int, dark: bool) -> None:
    seen = Seen(browser, address, width, dark=dark)
    assert overflow(seen.page) == 0
    seen.page.evaluate("for (const fold of document.querySelectorAll('details')) fold.open = true")
    assert overflow(seen.page) == 0
    found = axe.Axe().run(seen.page, context=PLOTS).response["violations"]
    assert not [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
    assert (seen.said, seen.asked) == ([], [address])
    marks = seen.page.locator("figure .plot > svg text").evaluate_all("all => all.map(e => getComputedStyle(e).fill)")
    assert set(marks) == {seen.page.evaluate("getComputedStyle(document.body).color")}
    light = seen.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert light != dark
    seen.page.close()


def test_the_measures_would_see_a_fault(browser: Any, address: str) -> None:
    seen = Seen(browser, address, 400)
    seen.page.evaluate(
        "document.querySelector('main').insertAdjacentHTML('afterbegin',"
        '\'<p id="fault" style="width:500px;color:#888;background:#999">wide<button></button></p>\');'
        "console.log('said')"
    )
    assert overflow(seen.page) > 0
    found = axe.Axe().run(seen.page, context={"include": [["#fault"]]}).response["violations"]
    impacts = {v["impact"] for v in found}
    assert {"serious", "critical"} <= impacts
    assert seen.said == ["said"]
    seen.page.close()


def test_a_heading_sorts_and_says_so(wide: Any) -> None:
    table = wide.locator("section table.main").first
    heading = table.locator("thead th", has_text="ATE online")
    column = heading.evaluate("heading => heading.cellIndex") + 1
    values = table.locator(f"tbody tr > :nth-child({column})")

    def numbers() -> list[float]:
        return [float(text) for text in values.evaluate_all("cells => cells.map(c => c.dataset.v ?? 'Infinity')")]

    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "ascending"
    assert numbers() == sorted(numbers())
    heading.locator("button").press("Enter")
    assert heading.get_attribute("aria-sort") == "descending"
    finite = [value for value in numbers() if value != float("inf")]
    assert finite == sorted(finite, reverse=True)
    assert len(finite) == 3
    table.locator("thead th button").first.click()
    assert heading.get_attribute("aria-sort") is None
    names = table.locator("tbody th").all_inner_texts()
    assert names == sorted(names)


def test_rows_are_filtered(wide: Any) -> None:
    wide.locator("details.long > summary").click()
    cells = wide.locator("table.cells tbody tr")
    assert cells.count() == 20
    box = wide.locator("details.long input[type=search]")
    box.fill("ROOM isam2")
    assert cells.locator("visible=true").count() == cells.filter(has_text="isam2").locator("visible=true").count()
    assert wide.locator("details.long [role=status]").inner_text() == "6 of 20 rows"
    box.fill("")
    assert wide.locator("table.cells tbody tr[hidden]").count() == 0


def test_a_backend_is_hidden_everywhere_and_comes_back(wide: Any) -> None:
    toggle = wide.locator(".bar button[data-of]", has_text="ekf")
    k = toggle.get_attribute("data-of")
    drawn = wide.locator(f"figure:not(.panel) svg .of-{k}")
    panel = wide.locator(f"figure.panel.of-{k}").first
    assert drawn.count() > 4
    assert panel.is_visible()
    toggle.click()
    assert toggle.get_attribute("aria-pressed") == "false"
    assert drawn.evaluate_all("all => all.every(g => getComputedStyle(g).display === 'none')")
    assert not panel.is_visible()
    row = wide.locator(f"table.main tr.of-{k}").first
    assert row.evaluate("row => getComputedStyle(row).opacity") == "0.4"
    pair = wide.locator(f"table.pairs tr.of-{k}").first
    other = next(m for m in re.findall(r"of-(\d+)", pair.get_attribute("class") or "") if m != k)
    wide.locator(f".bar button[data-of='{other}']").click()
    toggle.click()
    assert "off" in (pair.get_attribute("class") or "")  # the other of the two is still hidden
    wide.get_by_role("button", name="None", exact=True).click()
    assert wide.locator("figure svg .off").count() == wide.locator("figure svg [class*='of-']").count()
    wide.get_by_role("button", name="All", exact=True).click()
    assert wide.locator(".off").count() == 0


def test_a_plot_answers_pointer_and_keys(wide: Any) -> None:
    figure = wide.locator("figure", has=wide.locator(".title", has_text="Position error")).first
    plot, tip = figure.locator(".plot"), figure.locator(".tip")
    plot.scroll_into_view_if_needed()
    assert not tip.is_visible()
    plot.hover()
    told = tip.inner_text()
    assert "time, s" in told
    assert all(name in told for name in BACKENDS)
    wide.mouse.move(1, 1)
    assert not tip.is_visible()
    plot.focus()
    plot.press("End")
    last = plot.get_attribute("aria-valuetext")
    plot.press("ArrowLeft")
    assert tip.is_visible()
    assert plot.get_attribute("aria-valuenow") == "99"
    assert plot.get_attribute("aria-valuetext") != last
    assert "isam2" in (plot.get_attribute("aria-valuetext") or "")
    plot.press("Escape")
    assert not tip.is_visible()
    wide.locator(".bar button[data-of]", has_text="ekf").click()
    plot.hover()
    assert "ekf" not in tip.inner_text()


def test_a_point_is_where_the_plot_says_it_is(wide: Any) -> None:
    """The mark that a path's slider sets stands on the path that is drawn."""
    panel = wide.locator("figure.panel").first
    panel.scroll_into_view_if_needed()
    wide.locator(".time input").first.fill("3")
    distance = panel.evaluate(
        """figure => {
          const dot = figure.querySelector(".plot .dot");
          const at = [dot.cx.baseVal.value, dot.cy.baseVal.value];
          let least = Infinity;
          for (const path of figure.querySelectorAll("svg g[class*='of-'] path")) {
            for (let s = 0; s <= path.getTotalLength(); s += 0.5) {
              const p = path.getPointAtLength(s);
              least = Math.min(least, Math.hypot(p.x - at[0], p.y - at[1]));
            }
          }
          return least;
        }"""
    )
    assert distance < 2


def test_touch_is_answered(browser: Any, address: str) -> None:
    context = browser.new_context(viewport={"width": 400, "height": 850}, has_touch=True)
    page = context.new_page()
    page.goto(address)
    plot = page.locator("figure.panel .plot").first
    plot.scroll_into_view_if_needed()
    plot.tap()
    assert plot.locator(".tip").is_visible()
    assert "x, m" in plot.locator(".tip").inner_text()
    page.locator("h1").tap()
    assert not plot.locator(".tip").is_visible()
    small = page.evaluate(
        "[...document.querySelectorAll('button, input')].filter(e => e.checkVisibility() && !e.closest('thead')"
        " && e.getBoundingClientRect().height < 32).length"
    )
    assert small == 0
    context.close()


def test_time_is_scrubbed_and_played(wide: Any) -> None:
    slider = wide.locator(".time input").first
    section = wide.locator("section:has(.time)").first
    assert section.locator(".dot").count() == 0
    slider.fill("2")  # the slider has 500 stops
    assert section.locator("figure.panel .dot").count() >= 3
    assert section.locator(".cursor").count() >= 2
    assert wide.locator(".time output").first.inner_text() == "1.99 s"
    before = section.locator(".cursor").first.get_attribute("x1")
    slider.focus()
    slider.press("ArrowRight")
    assert section.locator(".cursor").first.get_attribute("x1") != before
    play = wide.locator(".time button").first
    play.click()
    while float(slider.input_value()) <= 2.3:  # the page lets no string be run, so the waiting is done here
        wide.wait_for_timeout(50)
    play.click()
    assert play.inner_text() == "Play"


def test_light_and_dark_change_places(wide: Any) -> None:
    ground = "getComputedStyle(document.body).backgroundColor"
    before = wide.evaluate(ground)
    wide.get_by_role("button", name="Dark page").click()
    assert wide.evaluate(ground) != before
    assert wide.locator(".plot svg text").first.evaluate("text => getComputedStyle(text).fill") != "rgb(28, 30, 33)"
    wide.get_by_role("button", name="Light page").click()
    assert wide.evaluate(ground) == before


def test_folds_open(wide: Any) -> None:
    fold = wide.locator("details", has_text="Where it ran").last
    inside = fold.get_by_text("abacus & sons")
    assert not inside.is_visible()
    fold.locator("summary").press("Enter")
    assert inside.is_visible()


def test_print_hides_nothing_that_matters(wide: Any) -> None:
    wide.emulate_media(media="print", color_scheme="dark")
    assert wide.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    for text in ("abacus & sons", "Traceback", about("step_us_p50").meaning, "cells.csv has them"):
        assert wide.get_by_text(text).last.is_visible(), text
    assert wide.locator("table.pairs").first.is_visible()
    assert not wide.locator("table.cells").is_visible()  # a table of hundreds of rows, which says where it is
    for control in (".time", ".filter", ".bar .rest", "header > button"):
        assert not wide.locator(control).first.is_visible()
    assert overflow(wide) == 0


def test_everything_is_there_without_a_script(browser: Any, address: str) -> None:
    plain, running = Seen(browser, address, 400, script=False), Seen(browser, address, 400)
    assert overflow_without_script(plain.page)
    assert plain.page.locator("button, input, .tip, .time").count() == 0
    assert plain.page.locator("svg").count() >= running.page.locator("figure .plot > svg").count() > 10
    assert plain.page.locator("table.main").first.is_visible()
    assert plain.page.locator(".bar").inner_text().split() == running.page.locator(".bar").inner_text().split()[:-2]
    for selector in ("table.sorts tbody", "dl", "figcaption", ".verdict", ".use"):
        for page in (plain.page, running.page):
            assert page.locator(selector).count() > 0
        texts = [page.locator(selector).all_text_contents() for page in (plain.page, running.page)]
        assert texts[0] == texts[1]
    plain.page.locator("details.long > summary").click()
    assert plain.page.locator("table.cells").is_visible()
    plain.page.close()
    running.page.close()


def overflow_without_script(page: Any) -> bool:
    """Whether the picture of the whole page is as wide as the window: nothing can be asked where no script runs."""
    width = int.from_bytes(page.screenshot(full_page=True)[16:20], "big")
    return width == page.viewport_size["width"]


def test_a_large_report_stays_in_its_budget_and_opens(browser: Any, tmp_path: Path) -> None:
    made = big(tmp_path / "r")
    write_report(made.store)
    made.store.close()
    path = tmp_path / "r" / "report.html"
    assert path.stat().st_size < BUDGET
    seen = Seen(browser, path.as_uri())
    assert seen.page.locator("table.cells tbody tr").count() == 450
    first = seen.page.locator("table.overview tbody tr")
    assert first.count() == 5
    assert max(box["y"] + box["height"] for box in (row.bounding_box() for row in first.all())) < 900
    assert (seen.said, seen.asked) == ([], [path.as_uri()])
    seen.page.close()
