"""Tells if a page fits a window of 400 px, as laid out by Chromium, with all details opened."""

import html
import re
import shutil
import subprocess
from pathlib import Path

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def fits(text: str, folder: Path) -> bool:
    """Tells if nothing of the page `text` overflows; `folder` is for the browser's files."""
    return _width(text, folder) == "400 400"


def would_be_seen(text: str, folder: Path) -> bool:
    """Tells if something wide in the page `text` would be detected."""
    return not fits(text.replace("<main>", '<main><p style="width:500px">x</p>'), folder)


def _width(text: str, folder: Path) -> str:
    """Width of the window, and of its content."""
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    harness = folder / "harness.html"
    opened = html.escape(text.replace("<details>", "<details open>"))
    harness.write_text(
        f"<!DOCTYPE html><iframe style='width:400px;height:4000px;border:0' srcdoc=\"{opened}\"></iframe><script>"
        "onload = () => { const d = document.querySelector('iframe').contentDocument.documentElement;"
        "document.title = `${d.clientWidth} ${d.scrollWidth}`; }</script>",
        encoding="utf-8",
    )
    options = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    more = f"--disable-component-update --disable-sync --hide-scrollbars --user-data-dir={folder / 'profile'}"
    command = [CHROMIUM, *options.split(), *more.split(), "--dump-dom", harness.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    found = re.search("<title>([^<]*)</title>", done.stdout.rpartition("</iframe>")[0] + done.stdout)
    return "" if found is None else found[1]
