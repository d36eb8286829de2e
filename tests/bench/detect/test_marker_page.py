"""The report on markers: all that was found, for any recording."""

import html
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from html_page import Page
from slamduel.bench.detect import markers as detecting
from slamduel.bench.detect.folder import Request
from slamduel.bench.detect.markers import MarkerFindings, detect
from slamduel.bench.detect.noise_calibration import range_bins, range_table
from slamduel.bench.detect.sightings import in_log
from slamduel.core.factors import Truth
from slamduel.frontend.markers.aruco import Rejections
from slamduel.frontend.markers.pipeline import Recording
from small_recording import sighting, small_recording
from tiers import first_quick


def made(out: Path, recording: Recording, truth: Truth | None, **request: Any) -> tuple[MarkerFindings, str]:
    findings = detect(recording, truth, Request("drive", out, **request), lambda _: None)
    return findings, (out / "detection.html").read_text(encoding="utf-8")


def test_the_page_tells_what_was_found(tmp_path: Path) -> None:
    findings, text = made(tmp_path / "log's", *small_recording(np.random.default_rng(0), 90), calibrate_noise=True)
    assert "told &lt;b&gt;" in text
    words = Page(text).words
    kept = in_log(findings.sightings)
    assert f"{len(kept.ids)} sightings of {len(set(kept.ids.tolist()))} markers in 90 frames" in words
    for row in findings.markers:
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
        recording = replace(recording, detector=replace(told, told=(([], Rejections()),) * frames))
    elif case == "one sighting":
        alone = ([sighting(5, 1.0, 0.2)], Rejections())
        recording = replace(recording, detector=replace(told, told=(alone, *(([], Rejections()),) * frames)))
    elif case == "all far":
        recording = replace(recording, max_range=0.1)
    elif case == "many markers":
        seen = [[sighting(7 * k % 97 + j, 1.0 + 0.03 * k, 0.2) for j in range(8)] for k in range(frames)]
        every = tuple((sightings, Rejections()) for sightings in seen)
        recording = replace(recording, detector=replace(told, told=every))
    findings, text = made(tmp_path / "log", recording, None if case == "no truth" else truth)
    page = Page(text)
    assert "truth" not in page.words.partition("Settings")[0].lower() or case != "no truth"
    assert ("Nothing & nowhere." in page.words) == (case in ("no sightings", "one sighting"))
    assert len(text) < 3e6
    assert len(findings.log) == frames
