"""The occupancy grids of a replay: of the scans so far, along the path that a backend has at that moment."""

import base64
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pages
from laps import SIDE, laps
from slamduel.bench.cli import main
from slamduel.bench.record.store import Store
from slamduel.bench.replay import course as replay_course
from slamduel.bench.replay import rerun
from slamduel.bench.replay.frames import SOFT, WIDTH, pictures
from slamduel.bench.replay.grids import Raster, Sketch
from slamduel.bench.replay.page import write_page
from slamduel.bench.replay.replay import Replay, choose, replay
from slamduel.bench.replay.view import View, view
from slamduel.bench.workers.tasks import Ended
from slamduel.core.beside import Scans
from slamduel.core.factors import Dataset
from slamduel.core.relations import Anchors
from slamduel.core.se2 import Array, compose
from slamduel.datasets.formats import log_folder
from slamduel.frontend.maps.occupancy import FREE, UNKNOWN, WALL

LOW, HIGH = -2.0, 12.0
"""m: the walls of a square room around the laps."""

FRAMES, LAP = 80, 4 * SIDE
BACKENDS = ["dead-reckoning", "graph", "smoother", "misbehaving:raises_on_loops"]


def scanned(dataset: Dataset, beams: int = 120) -> Dataset:
    """A scan all round at every step."""
    poses = dataset.truth.poses
    n, angles = len(poses), np.linspace(-np.pi, np.pi, beams, endpoint=False) + 0.013
    c, s = np.cos(poses[:, 2:] + angles), np.sin(poses[:, 2:] + angles)
    ranges = np.minimum(
        (np.where(c > 0, HIGH, LOW) - poses[:, :1]) / c, (np.where(s > 0, HIGH, LOW) - poses[:, 1:2]) / s
    )
    at = Anchors(np.arange(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n))
    log = replace(dataset.log, scans=Scans(at, ranges.astype(np.float32), angles, np.zeros(3)))
    return Dataset(log, dataset.truth)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run on two laps: of dead reckoning, a batch method, a smoother, and a backend that raises at its fifth step."""
    base = tmp_path_factory.mktemp("grids")
    log_folder.write(base / "room", *scanned(laps(np.random.default_rng(3), 2)))
    words = ["--backend", ",".join(BACKENDS), "--dataset", str(base / "room"), "--seeds", "1"]
    with pytest.MonkeyPatch.context() as patch:
        pages.left_out(patch)
        assert main(["run", "--quiet", *words, "--out", str(base / "run")]) == 1  # of which one raises
    return base / "run"


@pytest.fixture(scope="module")
def shown(folder: Path) -> Replay:
    with Store(folder) as store:
        return replay(store, choose(store, None, None, None), FRAMES, 2)


@pytest.fixture(scope="module")
def seen(shown: Replay) -> View:
    return view(shown)


def cells_hit(shown: Replay, path: Array, steps: int, cells: Raster) -> set[tuple[int, int]]:
    """The cells with a hit of the first scans."""
    scans = shown.log.log.scans
    heading = path[:steps, 2:] + scans.angles
    x = path[:steps, :1] + scans.ranges[:steps] * np.cos(heading)
    y = path[:steps, 1:2] + scans.ranges[:steps] * np.sin(heading)
    places = np.floor((np.stack((x, y), axis=-1).reshape(-1, 2) - cells.origin) / cells.size).astype(int)
    return {(i, j) for i, j in places.tolist() if 0 <= i < cells.shape[0] and 0 <= j < cells.shape[1]}


def walls(sketch: Sketch) -> set[tuple[int, int]]:
    return {(i, j) for i, j in np.argwhere(sketch.states == WALL).tolist()}


def test_the_walls_are_what_the_scans_so_far_hit_along_the_shown_path(shown: Replay, seen: View) -> None:
    assert seen.cells is not None
    for k, which in ((0, "online"), (1, "final")):
        panel, path = seen.panels[k], shown.parts[k].course.path
        assert len(panel.grids) == replay_course.MOMENTS, which
        for grid in (panel.grids[0], panel.grids[9], panel.grids[-1]):
            last = int(shown.frames[grid.frame])
            hit = cells_hit(shown, path, len(path) if grid.frame == FRAMES - 1 else last, seen.cells)
            assert walls(grid) <= hit
            assert len(walls(grid)) > 0.5 * len(hit)
            x, y = np.floor((path[last // 2, :2] - seen.cells.origin) / seen.cells.size).astype(int)
            assert grid.states[x, y] == FREE
            assert grid.states[0, 0] == UNKNOWN


def test_a_smoothers_path_is_the_one_it_has_at_the_moment(folder: Path, shown: Replay) -> None:
    course = shown.parts[2].course
    with Store(folder) as store:
        row = next(row for row in store.cells() if row.columns["backend"] == "smoother")
        recorded = store.arrays(row)
    truth = shown.log.truth
    assert [revised.frame for revised in course.revised] == replay_course.moments(FRAMES)
    assert course.revised[-1].path.tobytes() == recorded["final"].tobytes()
    for frame, path in course.revised:
        k = int(shown.frames[frame])
        assert len(path) == k + 1
        if k < LAP:  # no loop closure yet: the odometry alone
            assert np.allclose(path, shown.reckoned[: k + 1], rtol=0, atol=1e-6)
        assert np.allclose(path[-1], course.path[k], rtol=0, atol=0.02)
    before, after = course.path, course.revised[-1].path
    errors = [np.hypot(*(path - truth.poses)[:, :2].T).mean() for path in (before, after)]
    assert errors[1] < 0.8 * errors[0]  # the loop closures of the second lap mend the first one
    assert not any(part.course.revised for part in shown.parts if part.label != "smoother")


def test_its_last_grid_is_along_the_final_path(shown: Replay, seen: View) -> None:
    assert seen.cells is not None
    path = shown.parts[2].course.revised[-1].path
    assert walls(seen.panels[2].grids[-1]) <= cells_hit(shown, path, len(path), seen.cells)


def test_what_raises_has_grids_as_far_as_it_came(shown: Replay, seen: View) -> None:
    panel = seen.panels[3]
    assert len(panel.pose) == len(panel.hits)
    assert all(grid.frame < len(panel.pose) for grid in panel.grids)
    assert shown.parts[3].remark.startswith("stops after 4 steps: ValueError: ")


def test_the_newest_scan_is_seen_from_the_backends_pose(shown: Replay, seen: View) -> None:
    scans = shown.log.log.scans
    for panel in seen.panels[:3]:
        for k in (0, 31, FRAMES - 1):
            every = [
                compose(panel.pose[k], np.array((r * np.cos(a), r * np.sin(a), 0.0)))[:2]
                for r, a in zip(scans.ranges[shown.frames[k]].astype(float), scans.angles, strict=True)
            ]
            assert len(panel.hits[k]) == 60  # every other one of 120
            assert np.abs(panel.hits[k] - np.array(every)[::2]).max() < 1e-6


def test_the_whole_room_is_on_the_panels(seen: View) -> None:
    assert (seen.low < LOW + 0.1).all()
    assert (seen.high > HIGH - 0.1).all()
    assert (seen.cells.origin == seen.low).all()
    assert (seen.cells.origin + seen.cells.size * np.array(seen.cells.shape) >= seen.high - 1e-9).all()


def test_a_slow_smoother_has_fewer_grids_and_says_so(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_course, "REVISED_S", 1e-9)

    def here(run: Callable[[Any], Any], tasks: Sequence[Any], **_: Any) -> Iterator[Ended]:
        for k, task in enumerate(tasks):
            yield Ended(k, run(task), "", True, 0.0)

    monkeypatch.setattr("slamduel.bench.replay.replay.execute", here)
    with Store(folder) as store:
        (part,) = replay(store, choose(store, None, "smoother", None), FRAMES, 1).parts
    assert [revised.frame for revised in part.course.revised] == [FRAMES - 1]
    assert part.remark == "its grid is drawn at 1 frame, as its smoothed path is slow"


@pytest.fixture(scope="module")
def page(folder: Path) -> Path:
    assert main(["replay", str(folder), "--frames", str(FRAMES), "--quiet"]) == 0
    (found,) = folder.glob("replay-*-0.html")
    return found


def test_the_page_has_every_grid_as_a_picture_over_its_panel(page: Path, seen: View) -> None:
    from PIL import Image

    text = page.read_text(encoding="utf-8")
    images = re.findall(
        r'<image class="grid" y="([^"]+)" width="1000" height="([^"]+)" .*?base64,([^"]+)"(.*?)/>', text
    )
    grids = [grid for panel in seen.panels for grid in panel.grids]
    assert len(images) == len(grids)
    height = 1000 * (seen.high - seen.low)[1] / (seen.high - seen.low)[0]
    for (y, tall, content, style), grid in zip(images, grids, strict=True):
        assert abs(float(y) + float(tall) - height) < 0.02  # both end at the panel's foot
        alpha = np.array(Image.open(BytesIO(base64.b64decode(content))).convert("RGBA"))[..., 3]
        states = grid.states.T[::-1]
        assert (alpha[states == UNKNOWN] == 0).all()
        assert (alpha[states == WALL] == 255).all()
        assert ((alpha[states == FREE] > 0) & (alpha[states == FREE] < 100)).all()
        assert (style == "") == any(grid is panel.grids[-1] for panel in seen.panels if panel.grids)
    run = json.loads(re.findall(r'id="run">(.*?)</script>', text)[0])
    assert [told["grids"] for told in run["panels"]] == [[g.frame for g in panel.grids] for panel in seen.panels]


def test_the_chart_begins_where_the_error_is_known(seen: View, tmp_path: Path) -> None:
    panels = [panel._replace(error=np.where(np.arange(len(panel.error)) < 2, np.nan, 0.5)) for panel in seen.panels]
    write_page(tmp_path / "x.html", seen._replace(known="truth", panels=panels))
    chart = re.findall(r'id="errors">(.*?)</svg>', (tmp_path / "x.html").read_text(encoding="utf-8"), re.DOTALL)[0]
    assert "None" not in chart
    first = f"M{round(2000 / (FRAMES - 1))} "
    assert [d.startswith(first) for d in re.findall(r'" d="([^"]*)"/>', chart)[:3]] == 3 * [True]


@pytest.mark.slow
def test_the_script_shows_the_newest_grid_of_each_frame(browser: Any, page: Path, seen: View) -> None:
    tab = browser.new_page()
    said: list[str] = []
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.goto(page.as_uri())
    tab.keyboard.press("Home")
    for frame in range(6):
        shown = tab.evaluate(
            "[...document.querySelectorAll('.run')].map(run => [...run.querySelectorAll('image')]"
            ".flatMap((image, k) => image.style.display === 'none' ? [] : [k]))"
        )
        behind = [sum(grid.frame <= frame for grid in panel.grids) for panel in seen.panels]
        assert shown == [[count - 1] if count else [] for count in behind]
        tab.keyboard.press("ArrowRight")
    assert said == []
    tab.close()


def test_a_film_has_the_walls(seen: View) -> None:
    *_, last = pictures(seen)
    panel = last[40:, 10 : 10 + WIDTH]  # of dead reckoning
    scale = WIDTH / (seen.high - seen.low)[0]
    dark = 0
    places = seen.cells.origin + seen.cells.size * (np.argwhere(seen.panels[0].grids[-1].states == WALL) + 0.5)
    for x, y in places:
        row, column = int((seen.high[1] - y) * scale), int((x - seen.low[0]) * scale)
        dark += panel[row, column].max() < 190
    assert dark > 0.9 * len(places)
    assert SOFT in {tuple(pixel) for pixel in panel.reshape(-1, 3).tolist()}


def test_a_recording_for_rerun_has_walls_and_scans(seen: View, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: slamduel[replay] has it")
    rerun.write_rrd(tmp_path / "a.rrd", seen)
    content = (tmp_path / "a.rrd").read_bytes()
    for name in ("/backends/smoother/walls", "/backends/smoother/scan", "/backends/graph/walls"):
        assert name.encode() in content
