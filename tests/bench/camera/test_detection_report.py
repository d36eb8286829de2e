"""The detection report: one page that needs nothing else, for any recording, and that fits any window."""

import base64
import html
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from narrow_window import fits, would_be_seen
from slamduel.bench.camera import detect as detecting
from slamduel.bench.camera.detect import DetectRequest, detect
from slamduel.bench.camera.figures import range_bins
from slamduel.bench.camera.noise_calibration import range_table
from slamduel.bench.camera.sightings import in_log
from slamduel.bench.camera.summary import Findings, marker_rows
from slamduel.core.factors import Truth
from slamduel.frontend.markers.pipeline import Recording
from small_recording import sighting, small_recording
from tiers import first_quick


class Page(HTMLParser):
    """Its elements, checked to be closed in order, and its words."""

    EMPTY = frozenset({"meta", "link", "br", "hr", "img", "input"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.EMPTY:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data + " "


def made(out: Path, recording: Recording, truth: Truth | None, **request: Any) -> tuple[Findings, str]:
    findings = detect(recording, truth, DetectRequest("drive", out, **request), lambda _: None)
    return findings, (out / "detection.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Findings, str]:
    out = tmp_path_factory.mktemp("d") / "log's"
    return made(out, *small_recording(np.random.default_rng(0), 90), calibrate_noise=True)


def test_the_page_needs_nothing_but_itself(calibrated: tuple[Findings, str]) -> None:
    page = Page(calibrated[1])
    tags = Counter(tag for tag, _ in page.elements)
    assert not {"script", "link", "iframe", "object", "b"} & tags.keys()
    assert tags["svg"] == 7
    assert tags["img"] == 12
    targets = [value or "" for _, attrs in page.elements for name, value in attrs.items() if name in ("src", "href")]
    assert not [target for target in targets if ":" in target and not target.startswith("data:image/jpeg;base64,")]
    for _, attrs in page.elements:
        if (attrs.get("src") or "").startswith("data:"):
            content = np.frombuffer(base64.b64decode((attrs["src"] or "").partition(",")[2]), np.uint8)
            image = cv2.imdecode(content, cv2.IMREAD_COLOR)
            assert image is not None
            assert image.shape == (360, 480, 3)
            assert attrs["alt"]
    assert "@import" not in calibrated[1]
    assert set(re.findall(r"url\(([^)])", calibrated[1])) <= {"#"}
    assert "told &lt;b&gt;" in calibrated[1]
    assert not re.search("#0[1-9]0[1-9]0[1-9]", calibrated[1])  # no stand-in colour is left


def test_the_page_tells_what_was_found(calibrated: tuple[Findings, str], tmp_path: Path) -> None:
    findings, text = calibrated
    words = " ".join(Page(text).words.split())
    kept = in_log(findings.sightings)
    assert f"{len(kept.ids)} sightings of {len(set(kept.ids.tolist()))} markers in 90 frames" in words
    for row in marker_rows(findings):
        assert f"{row.id} {row.sightings} {row.first:.2f} {row.last:.2f} {row.nearest:.2f} {row.farthest:.2f}" in words
    for told in ("same id twice in a frame 6", "sightings beyond 3 m", "k_range =", "overconfident", "side 0.16 m"):
        assert told in words
    for one in findings.bins:
        assert f"{one.low:g} to {one.high:g} {one.sightings} {1e3 * one.range_mean:+.1f}" in words
    assert html.escape("bench run --dataset '") in text.replace("&#39;", "&#x27;")


def test_bins_are_the_errors_by_range() -> None:
    rng = np.random.default_rng(1)
    z, errors = rng.uniform((0.2, -1), (5, 1), (300, 2)), rng.normal(size=(300, 2))
    covs = np.tile(np.diag([4.0, 0.25]), (300, 1, 1))
    edges = range_bins(z[:, 0])
    bins = range_table(z, errors, [covs], edges)
    assert sum(one.sightings for one in bins) == 300
    assert 5 <= len(bins) <= 10
    for one in bins:
        mine = (one.low <= z[:, 0]) & (z[:, 0] < one.high)
        assert one.range_mean == pytest.approx(errors[mine, 0].mean())
        assert one.bearing_sd == pytest.approx(errors[mine, 1].std())
        assert one.nees == [pytest.approx((errors[mine] ** 2 @ [0.25, 4.0]).mean() / 2)]


@pytest.mark.parametrize("top", [1e-3, 0.04, 0.5, 1.0, 2.999, 3.0, 47.0, 900.0])
def test_edges_cover_every_range(top: float) -> None:
    edges = range_bins(np.array([top / 3, top]))
    assert edges[0] == 0
    assert edges[-2] <= top < edges[-1]
    assert 1 <= len(edges) - 1 <= 10
    assert len(range_bins(np.zeros(0))) >= 2


@pytest.mark.parametrize(
    "case", first_quick(["no sightings", "one sighting", "no truth", "one frame", "all far", "many markers"], 2)
)
def test_any_recording_has_a_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    monkeypatch.setattr(detecting, "diagnose", lambda *_: ["Nothing & nowhere."])
    frames = {"one frame": 1, "many markers": 60}.get(case, 30)
    recording, truth = small_recording(np.random.default_rng(0), frames)
    told: Any = recording.detector
    if case == "no sightings":
        recording = replace(recording, detector=replace(told, told=(([], Counter[str]()),) * frames))
    elif case == "one sighting":
        alone = ([sighting(5, 1.0, 0.2)], Counter[str]())
        recording = replace(recording, detector=replace(told, told=(alone, *(([], Counter[str]()),) * frames)))
    elif case == "all far":
        recording = replace(recording, max_range=0.1)
    elif case == "many markers":
        seen = [[sighting(7 * k % 97 + j, 1.0 + 0.03 * k, 0.2) for j in range(8)] for k in range(frames)]
        every = tuple((sightings, Counter[str]()) for sightings in seen)
        recording = replace(recording, detector=replace(told, told=every))
    findings, text = made(tmp_path / "log", recording, None if case == "no truth" else truth)
    page = Page(text)
    assert "truth" not in page.words.partition("Settings")[0].lower() or case != "no truth"
    assert ("Nothing & nowhere." in page.words) == (case in ("no sightings", "one sighting"))
    assert len(text) < 3e6
    assert len(findings.t) == frames


@pytest.mark.slow
def test_nothing_sticks_out_of_a_narrow_window(calibrated: tuple[Findings, str], tmp_path: Path) -> None:
    assert fits(calibrated[1], tmp_path)
    assert would_be_seen(calibrated[1], tmp_path)
