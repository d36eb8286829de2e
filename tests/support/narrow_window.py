"""Whether a page fits a window of 400 px, as Chromium lays it out, with all that folds opened."""

import html
import re
import shutil
import subprocess
from pathlib import Path

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def fits(text: str, folder: Path) -> bool:
    """Whether nothing of the page `text` sticks out; `folder` is for what the browser writes."""
    return _width(text, folder) == "400 400"


def would_be_seen(text: str, folder: Path) -> bool:
    """Whether something wide in the page `text` is noticed."""
    return not fits(text.replace("<main>", '<main><p style="width:500px">x</p>'), folder)


def _width(text: str, folder: Path) -> str:
    """Width of the window, and of what is in it."""
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
