"""The page of a noise: its figures, and the autocorrelation drawn in one of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from noisy_logs import Slow, noisy
from slamduel.bench.noise.figures import autocorrelation, figures
from slamduel.bench.noise.gauss_markov import Chains
from slamduel.bench.noise.measured import measured
from slamduel.bench.noise.page import write_page
from slamduel.bench.noise.words import sentences


def test_the_autocorrelation_is_that_of_the_process() -> None:
    rng = np.random.default_rng(0)
    n, time = 20_000, 8.0
    r = np.exp(-1 / time)
    x = rng.standard_normal(n)
    for k in range(1, n):
        x[k] = r * x[k - 1] + np.sqrt(1 - r * r) * x[k]
    gap = np.ones(n)
    gap[:: n // 4] = np.inf
    found = autocorrelation(Chains(x, np.ones(n), np.ones(n), gap), np.ones(n))
    assert len(found.lag) > 5
    assert found.value == pytest.approx(np.exp(-found.lag / time), abs=0.1)


def test_a_page_has_what_was_found_in_words_numbers_and_figures(tmp_path: Path) -> None:
    noise = measured([noisy("circle[steps=300]", 0, Slow(share=0.9, time=9.0))], ["<circle>"])
    assert [one.name for one in figures(noise)] == [
        "noise-range", "noise-bearing", "noise-correlation", "noise-quantiles", "noise-odometry",
    ]  # fmt: skip
    path = tmp_path / "noise.html"
    write_page(path, noise)
    page = path.read_text(encoding="utf-8")
    assert "&lt;circle&gt;" in page
    assert "<circle>" not in page
    for sentence in sentences(noise):
        assert sentence.replace("'", "&#39;") in page
    assert page.count("<figcaption>") == 5
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page


def test_a_log_without_sightings_has_the_figure_of_its_odometry() -> None:
    dataset = noisy("circle[steps=300]", 0)
    bare = replace(dataset.log, ids=np.full_like(dataset.log.ids, -1))
    assert [one.name for one in figures(measured([dataset._replace(log=bare)], ["x"]))] == ["noise-odometry"]
