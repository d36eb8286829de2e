"""Ranges alone are rings and bearings alone rays, in the page, the film and the recording; the report has residuals."""

import re
from pathlib import Path

import numpy as np
import pytest

from slamduel.bench.cli import main
from slamduel.bench.record.store import Store
from slamduel.bench.replay.frames import pictures
from slamduel.bench.replay.page import write_page
from slamduel.bench.replay.replay import choose, replay
from slamduel.bench.replay.view import View, view
from slamduel.core.partial import RANGE

WORLD = "circle[steps=60,odometry=0.01,ranges_only=0.5,bearings_only=0.5]"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("parts") / "run"
    words = ["--backend", "ekf", "--dataset", WORLD, "--seeds", "1", "--repeats", "1", "--out", str(out)]
    assert main(["run", "--quiet", *words]) == 0
    return out


@pytest.fixture(scope="module")
def seen(folder: Path) -> View:
    with Store(folder) as store:
        return view(replay(store, choose(store, None, None, None), 60, 1))


def test_rings_and_rays_are_what_was_measured(folder: Path, seen: View) -> None:
    with Store(folder) as store:
        shown = replay(store, choose(store, None, None, None), 60, 1)
    partial = shown.log.log.partial
    assert partial is not None
    panel, rings, rays = seen.panels[0], 0, 0
    for step, sighted in zip(seen.steps.tolist(), panel.sighted, strict=True):
        alone = partial.at(step)
        assert sighted.rings.tolist() == alone.z[alone.kind == RANGE].tolist()
        bearings = alone.z[alone.kind != RANGE]
        assert len(sighted.ends) == len(bearings)
        along = sighted.ends - sighted.origin
        found = np.arctan2(along[:, 1], along[:, 0]) - panel.pose[step, 2] - bearings
        assert np.cos(found) == pytest.approx(1)
        rings, rays = rings + len(sighted.rings), rays + len(sighted.ends)
    assert rings > 5
    assert rays > 5
    assert seen.rings


@pytest.mark.usefixtures("no_report")
def test_rings_are_less_the_estimated_scale(tmp_path: Path) -> None:
    out = tmp_path / "run"
    world = WORLD.replace("]", ",range_scale=0.2]")
    words = ["--backend", "ekf,graph", "--dataset", world, "--seeds", "1", "--repeats", "1", "--out", str(out)]
    assert main(["run", "--quiet", *words]) == 0
    with Store(out) as store:
        shown = replay(store, choose(store, None, None, None), 60, 1)
        rows = {row.columns["backend"]: row.columns for row in store.cells()}
    seen, partial = view(shown), shown.log.log.partial
    assert partial is not None
    assert seen.corrected
    for panel in seen.panels:
        scale = rows[panel.label]["range_scale"]
        assert abs(scale) > 0.01
        for step, sighted in zip(seen.steps.tolist(), panel.sighted, strict=True):
            alone = partial.at(step)
            assert sighted.rings * (1 + scale) == pytest.approx(alone.z[alone.kind == RANGE])
    write_page(tmp_path / "page.html", seen)
    assert "range alone, less the estimated scale" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_numbers_that_do_not_exist_are_not_shown_and_estimates_are_within(folder: Path) -> None:
    with Store(folder) as store:
        shown = replay(store, choose(store, None, None, None), 60, 1)
    part, truth = shown.parts[0], shown.log.truth
    assert truth is not None
    assert np.isfinite(view(shown).panels[0].step_us).any()
    batch = view(shown._replace(parts=[part._replace(course=part.course._replace(final=True))])).panels[0]
    assert np.isnan(batch.step_us).all()
    assert np.isfinite(batch.nees).all()
    doubted = shown._replace(log=shown.log._replace(truth=truth._replace(words="GPS")))
    assert np.isnan(view(doubted).panels[0].nees).all()
    before = view(shown)
    last = part.course.maps[-1]
    far = last.xy.copy()
    far[0] = before.high[0] + 0.01, 0.0
    moved = part._replace(course=part.course._replace(maps=[last._replace(xy=far)] * len(part.course.maps)))
    after = view(shown._replace(parts=[moved]))
    assert after.low[0] < far[0, 0] < after.high[0]


def test_the_page_and_the_film_have_them(seen: View, tmp_path: Path) -> None:
    write_page(tmp_path / "page.html", seen)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert '"rings":' in page.replace("&#34;", '"')
    assert "range alone, as measured" in page
    assert "</svg>sighting</span>" in page
    few = [one._replace(ends=one.ends[:0]) for one in seen.panels[0].sighted]
    none = [one._replace(ids=one.ids[:0], xy=one.xy[:0], cov=one.cov[:0]) for one in seen.panels[0].maps]
    placed = [[] for _ in seen.panels[0].places]
    panel = seen.panels[0]._replace(sighted=few, maps=none, places=placed)
    plain = seen._replace(places=seen.places[:0], panels=[panel])
    write_page(tmp_path / "plain.html", plain)
    key = (tmp_path / "plain.html").read_text(encoding="utf-8").split('class="key"')[1].split("</p>")[0]
    assert "range alone" in key
    assert "sighting" not in key
    assert "landmark" not in key
    with_ring = next(k for k, sighted in enumerate(seen.panels[0].sighted) if len(sighted.rings))
    bare = seen.panels[0]._replace(sighted=[one._replace(rings=one.rings[:0]) for one in seen.panels[0].sighted])
    drawn, without = (
        [frame.copy() for frame in pictures(one)][with_ring] for one in (seen, seen._replace(panels=[bare]))
    )
    assert (drawn != without).any()


def test_the_report_has_the_residuals_of_ranges_and_the_counts_of_beacons(folder: Path) -> None:
    with Store(folder) as store:
        row = next(iter(store.cells()))
        arrays, truth = store.arrays(row), store.truth(row)
    assert len(arrays["range_step"]) == len(arrays["range_off"]) > 5
    assert np.sqrt(np.mean(arrays["range_off"] ** 2)) < 0.3  # 0.1 m, and what the path and the map are off by
    assert truth["times"].sum() == row.columns["sightings"]
    figures = [file.name for file in (folder / "figures").iterdir()]
    assert any(re.search(r"-ranges\.svg$", name) for name in figures)
