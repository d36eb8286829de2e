"""The documentation site: every equation has code and tests that exist; the pages are built, fit and can be read."""

import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from docutils.utils.math import latex2mathml
from excerpts import documents, excerpt

from narrow_window import CHROMIUM
from places import ROOT

NUMBERED = {
    "ArUco": [f"({k})" for k in range(1, 21)],
    "EKF-based": [f"({c}-{k})" for c, last in ((2, 20), (3, 8), (4, 9)) for k in range(1, last + 1)],
}
"""The numbers that the documents print."""

WIDTHS = (1400, 400)


def test_every_numbered_equation_is_there_once() -> None:
    found = {
        document.title.split()[0]: [
            number for one in document.equations for number in re.findall(r"\(\d+(?:-\d+)?\)", one.number)
        ]
        for document in documents()
    }
    assert {name: sorted(numbers) for name, numbers in found.items() if numbers} == {
        name: sorted(numbers) for name, numbers in NUMBERED.items()
    }


def test_every_equation_has_code_and_a_test_that_exist() -> None:
    for one in (one for document in documents() for one in document.equations):
        assert one.code
        assert one.tests
        for test in one.tests:
            assert test.file.startswith("tests/"), test
            assert test.name.startswith("test_"), test
        assert "<math" in latex2mathml.tex2mathml(one.tex, as_block=True)


def test_what_does_not_exist_is_named() -> None:
    with pytest.raises(ValueError, match=r"backends/models\.py: no nothing"):
        excerpt("backends/models.py", "nothing")
    with pytest.raises(ValueError, match="no line of sight has 'nothing'"):
        excerpt("backends/models.py", "sight", "nothing")


def test_an_excerpt_has_the_lines_of_the_file() -> None:
    found = excerpt("backends/models.py", "innovation")
    lines = (ROOT / found.file).read_text().splitlines()
    assert found.text.splitlines()[0].startswith("def innovation(")
    assert lines[found.first - 1 : found.first + found.text.count("\n")] == found.text.splitlines()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `make docs` builds it, its notebook run."""
    pytest.importorskip("sphinx", reason="sphinx is not installed")
    out = tmp_path_factory.mktemp("site")
    flags = ["--quiet", "--fail-on-warning", "--keep-going", "-b", "html", "-d", out / "doctrees"]
    command = [sys.executable, "-m", "sphinx", *flags, ROOT / "docs", out / "html"]
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    done = subprocess.run(command, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-3000:]
    return out / "html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-quic"])


@pytest.mark.slow
def test_no_link_is_dead_and_nothing_is_fetched(site: Path) -> None:
    for page in site.glob("*.html"):
        text = page.read_text(encoding="utf-8")
        for link in re.findall(r"(?:href|src)=\"([^\"]+)\"", text):
            if "://" in link and not re.search(rf"<(?:script|img|link)[^>]+\"{re.escape(link)}\"", text):
                continue
            assert "://" not in link, (page.name, link)
            name, _, anchor = link.partition("#")
            target = page if not name else (site / name.partition("?")[0])
            assert target.exists(), (page.name, link)
            if anchor and target.suffix == ".html":
                assert f'id="{anchor}"' in target.read_text(encoding="utf-8"), (page.name, link)


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """The site as a server of this machine gives it."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: Any) -> None: ...  # noqa: A002

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
def test_pages_fit_are_quiet_and_can_be_read(site: Path, address: str, browser: Any, width: int, dark: bool) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light")
    page.set_default_timeout(120_000)  # ms
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    faults: list[Any] = []
    for file in sorted(site.glob("*.html")):
        page.goto(f"{address}/{file.name}")
        beyond = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        found = axe.Axe().run(page).response["violations"]
        grave = [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
        faults += [(file.name, beyond, grave, said[:])] if beyond or grave or said else []
        said.clear()
    page.close()
    assert faults == []
