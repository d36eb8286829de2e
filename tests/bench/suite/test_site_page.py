"""The benchmark's pages in a browser: nothing sticks out, nothing is fetched, everyone can read them."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from slamduel.bench.cli import main
from slamduel.bench.suite.history import keep, summarise
from slamduel.bench.suite.site import write_site
from slamduel.bench.suite.site_folder import suites

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
pytestmark = pytest.mark.slow

PLOTS = {"exclude": [["figure .plot > svg"]]}
"""What axe need not look into: marks of axes, all in the one colour of the page's text."""

TEXT = """
title = "A suite with a long title, so that it has to be broken where the window is narrow"
question = "Does it fit?"
note = "A note."
backend = ["dead-reckoning", "ekf", "ekf[gate=0.999,gate_after=4]", "smoother"]
seeds = 6
[[run]]
name = "circle"
dataset = ["circle[steps=50]", "circle[steps=60,landmarks=12,sensor_scale=2]"]
[[run]]
name = "absent"
dataset = "dlr"
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site with everything: a suite in two versions, a run that was skipped, and results of others."""
    place = tmp_path_factory.mktemp("site")
    (place / "wide.toml").write_text(TEXT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SLAMDUEL_CACHE", str(place / "cache"))
        out = ["--out", str(place / "site"), "--executor", "here", "--quiet"]
        assert main(["suite", str(place / "wide.toml"), *out]) == 0
        more = ["--dataset", "circle[steps=50]", "--seeds", "6", "--executor", "here", "--quiet"]
        assert main(["run", "--backend", "invariant-ekf,ukf", *more, "--out", str(place / "theirs")]) == 0
        assert main(["suite", "--add", str(place / "theirs"), *out]) == 0
    now = summarise(suites(place / "site")["wide"])
    assert now is not None
    keep(place / "site", replace(now, version="0.0.9", date="2020-01-01"))
    write_site(place / "site")
    return place / "site"


def opened(browser: Any, path: Path, width: int, *, dark: bool) -> tuple[Any, list[str], list[str]]:
    """A page with what it said and asked for, all its details opened."""
    shown = browser.new_page(viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light")
    said: list[str] = []
    asked: list[str] = []
    shown.on("console", lambda message: said.append(message.text))
    shown.on("pageerror", lambda error: said.append(str(error)))
    shown.on("request", lambda request: asked.append(request.url))
    shown.goto(path.as_uri())
    shown.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    return shown, said, asked


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
@pytest.mark.parametrize("name", ["index.html", "wide.html"])
def test_it_fits_is_quiet_and_everyone_can_read_it(browser: Any, site: Path, name: str, width: int, dark: bool) -> None:
    page, said, asked = opened(browser, site / name, width, dark=dark)
    assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
    found = axe.Axe().run(page, context=PLOTS).response["violations"]
    assert [(one["id"], [node["html"][:200] for node in one["nodes"]]) for one in found] == []
    assert said == []
    assert asked == [(site / name).as_uri()]
    page.close()


def test_every_link_leads_to_a_file(browser: Any, site: Path) -> None:
    for name in ("index.html", "wide.html"):
        page, _, _ = opened(browser, site / name, 1400, dark=False)
        links: list[str] = page.evaluate("[...document.links].map((one) => one.href)")
        assert len(links) > 8
        for link in dict.fromkeys(links):
            path = Path(link.removeprefix("file://").partition("#")[0].replace("%5B", "[").replace("%5D", "]"))
            assert path.is_file(), link
            anchor = link.partition("#")[2]
            if anchor:
                assert f'id="{anchor}"' in path.read_text(encoding="utf-8"), link
        page.close()


def test_a_fault_would_be_seen(browser: Any, site: Path, tmp_path: Path) -> None:
    copied = shutil.copy(site / "index.html", tmp_path / "index.html")
    wide = '<main><div id="fault" style="width:2000px;color:#888;background:#999">wide<button></button></div>'
    Path(copied).write_text(Path(copied).read_text().replace("<main>", wide))
    page, _, _ = opened(browser, Path(copied), 1400, dark=False)
    assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") > 0
    assert axe.Axe().run(page, context={"include": [["#fault"]]}).response["violations"]
    page.close()
