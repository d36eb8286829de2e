"""A replay draws positions and headings in the world, and where a landmark may be that is not placed yet."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pages
from slamduel.bench.cli import main
from slamduel.bench.record.store import Store
from slamduel.bench.replay import rerun
from slamduel.bench.replay.course import Course, Landmarks
from slamduel.bench.replay.frames import pictures
from slamduel.bench.replay.open_places import OpenPlaces
from slamduel.bench.replay.page import write_page
from slamduel.bench.replay.replay import Replay, choose, replay
from slamduel.bench.replay.view import ELLIPSE_95, View, view
from slamduel.core.factors import Log, Prior
from slamduel.core.partial import BEARING, RANGE, PartialTable

WORLD = "circle[steps=80,odometry=0.02,ranges_only=0.6,bearings_only=0.4,gps=7,gps_sd=0.5,compass=3]"
NONE = Landmarks(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Replay:
    out = tmp_path_factory.mktemp("world") / "run"
    words = ["--backend", "ekf,smoother", "--dataset", WORLD, "--seeds", "1", "--repeats", "1", "--out", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        pages.left_out(patch)
        assert main(["run", "--quiet", *words]) == 0
    with Store(out) as store:
        return replay(store, choose(store, None, None, None), 80, 1)


@pytest.fixture(scope="module")
def seen(shown: Replay) -> View:
    return view(shown)


def straight(seen: list[tuple[int, int, float]], steps: int) -> OpenPlaces:
    """A drive of a metre a step along x, without drift to speak of, with sightings (step, kind, z) of landmark 5."""
    step, kind, z = (np.array(column) for column in zip(*seen, strict=True))
    delta, none = np.tile([1.0, 0.0, 0.0], (steps, 1)), np.zeros(0, np.int64)
    table = PartialTable.from_arrays(
        steps, step, np.full(len(step), 5), kind, z.astype(float), np.full(len(step), 1e-4)
    )
    prior = Prior(np.zeros(3), 1e-6 * np.eye(3), None)
    log = Log.from_arrays(
        "straight", prior, np.arange(steps, dtype=float), delta, np.tile(1e-8 * np.eye(3), (steps, 1, 1)),
        none, none, np.zeros((0, 2)), np.zeros((0, 2, 2)), partial=table,
    )  # fmt: skip
    path = np.column_stack((np.arange(steps, dtype=float), np.zeros((steps, 2))))
    course = Course(path, np.zeros((0, 3, 3)), [], 0, False, "", [])
    return OpenPlaces(log, course, 40.0)


def pieces(line: Any) -> list[Any]:
    gaps = np.flatnonzero(np.isnan(line[:, 0]))
    return [piece[np.isfinite(piece[:, 0])] for piece in np.split(line, gaps) if np.isfinite(piece[:, 0]).any()]


def test_ranges_of_a_straight_drive_leave_two_mirrored_places() -> None:
    ranges = [(k, RANGE, float(np.hypot(6 - k, 3))) for k in range(9)]  # of a landmark at 6, 3
    places = straight(ranges, 9)
    assert places.at(0, NONE)[1] == []  # one range: a ring, which is drawn as the newest sighting
    _, (line,) = places.at(8, NONE)
    two = pieces(line)
    assert len(two) == 2
    assert sorted(float(np.sign(piece[:, 1].mean())) for piece in two) == [-1, 1]
    for piece in two:
        assert np.hypot(piece[:, 0] - 6, abs(piece[:, 1]) - 3).min() < 0.3  # points are 0.2 m apart on the last ring


def test_the_landmark_is_on_the_lines_19_times_of_20() -> None:
    rng = np.random.default_rng(3)
    inside, trials = 0, 200
    for _ in range(trials):
        place, n = np.array((rng.uniform(2, 10), rng.uniform(2, 5))), int(rng.integers(2, 9))
        z = np.hypot(place[0] - np.arange(n), place[1]) + 0.01 * rng.standard_normal(n)
        _, (line,) = straight([(k, RANGE, float(z[k])) for k in range(n)], n).at(n - 1, NONE)
        last = np.array((n - 1, 0))
        apart = 2 * np.pi / 90 * np.hypot(*(place - last))  # of two points of the ring
        inside += np.nanmin(np.hypot(*(line - place).T)) < apart
    assert inside / trials > 0.95 - 3 * np.sqrt(0.95 * 0.05 / trials)


def test_bearings_leave_a_stretch_of_a_ray() -> None:
    bearings = [(k, BEARING, float(np.arctan2(2, 20 - k))) for k in range(4)]  # at 20, 2: hardly a parallax
    _, (line,) = straight(bearings, 4).at(3, NONE)
    (stretch,) = pieces(line)
    direction = np.arctan2(stretch[:, 1], stretch[:, 0] - 3)
    assert np.abs(direction - np.arctan2(2, 17)).max() < 0.04  # sd 0.01
    away = np.hypot(stretch[:, 0] - 3, stretch[:, 1])
    assert away.min() < np.hypot(17, 2) < away.max()
    assert away.min() > 1


def test_a_landmark_is_open_until_it_is_placed() -> None:
    ranges = [(k, RANGE, float(np.hypot(6 - k, 3))) for k in range(9)]
    place = np.array([[6.0, 3.0]])
    known, guessed = (Landmarks(np.array([5]), place, np.full((1, 2, 2), sd)) for sd in (0.1, np.nan))
    places = straight(ranges, 9)
    kept, lines = places.at(4, guessed)
    assert len(kept.ids) == 0  # its dot would say that the place is known
    assert len(lines) == 1
    kept, lines = places.at(5, known)
    assert (kept.ids.tolist(), lines) == ([5], [])
    kept, lines = places.at(6, guessed)  # it stays so
    assert (kept.ids.tolist(), lines) == ([5], [])
    both = [*ranges, (8, BEARING, float(np.arctan2(3, -2)))]
    kept, lines = straight(both, 9).at(8, guessed)  # a bearing tells the side
    assert (kept.ids.tolist(), lines) == ([5], [])


def test_what_is_open_is_what_is_on_no_map_and_the_landmark_is_there(shown: Replay, seen: View) -> None:
    log, truth = shown.log
    assert log.partial is not None
    assert truth is not None
    assert truth.map is not None
    near, total = 0, 0
    panel, course = seen.panels[0], shown.parts[0].course
    for step, known, lines in zip(seen.steps.tolist(), course.maps, panel.places, strict=True):
        ids = log.partial.ids[: log.partial.first[step + 1]]
        count = {i: int((ids == i).sum()) for i in set(ids.tolist()) - set(known.ids.tolist())}
        still = sorted(i for i, n in count.items() if n > 1)
        assert len(lines) == len(still)
        for i in still:
            place = truth.map.xy[truth.map.ids == i]
            away = min(float(np.nanmin(np.hypot(*(line - place).T))) for line in lines)
            near, total = near + (away < 0.5), total + 1  # sd 0.1, and 0.35 m from one point of a ring to the next
    assert total > 8
    assert near == total
    assert seen.open


def test_positions_and_headings_are_the_measured_ones(shown: Replay, seen: View) -> None:
    fixes = shown.log.log.fixes
    assert fixes is not None
    positions, headings = np.isfinite(fixes.z[:, 0]), np.isfinite(fixes.z[:, 2])
    assert positions.sum() > 5
    assert headings.sum() > 20
    at = np.isfinite(seen.positions.xy).all(axis=1)
    assert seen.steps[at].tolist() == fixes.step[positions].tolist()
    assert seen.positions.xy[at].tolist() == fixes.z[positions, :2].tolist()
    assert seen.positions.ellipse[at][:, :2] == pytest.approx(0.5 * ELLIPSE_95)
    for panel in seen.panels:
        then = np.isfinite(panel.pointed).all(axis=1)
        assert seen.steps[then].tolist() == fixes.step[headings].tolist()
        assert panel.pointed[then, 2].tolist() == fixes.z[headings, 2].tolist()
        assert panel.pointed[then, :2].tolist() == panel.pose[then, :2].tolist()


def test_of_several_in_a_frame_the_newest_is_drawn(shown: Replay) -> None:
    few = shown._replace(frames=shown.frames[[0, 40, 79]], parts=[])
    fixes = shown.log.log.fixes
    assert fixes is not None
    steps = fixes.step[np.isfinite(fixes.z[:, 0])]
    seen = view(few)
    for k, (after, until) in enumerate([(-1, 0), (0, 40), (40, 79)]):
        inside = steps[(steps > after) & (steps <= until)]
        if len(inside):
            row = np.flatnonzero((fixes.step == inside[-1]) & np.isfinite(fixes.z[:, 0]))[-1]
            assert seen.positions.xy[k].tolist() == fixes.z[row, :2].tolist()
        else:
            assert np.isnan(seen.positions.xy[k]).all()


def key(page: Path) -> str:
    return page.read_text(encoding="utf-8").split('class="key"')[1].split("</p>")[0]


WORDS = ("where a landmark that is not placed yet may be", "position measured in the world", "heading measured in")


def test_the_page_has_them_and_says_so_only_then(shown: Replay, seen: View, tmp_path: Path) -> None:
    write_page(tmp_path / "all.html", seen)
    assert all(words in key(tmp_path / "all.html") for words in WORDS)
    run = json.loads(re.findall(r'id="run">(.*?)</script>', (tmp_path / "all.html").read_text(encoding="utf-8"))[0])
    assert run["when"][40] == "40.0 s  ·  step 40 of 79"  # this world has a step a second
    assert [k for k, one in enumerate(run["positions"]) if one] == np.flatnonzero(
        np.isfinite(seen.positions.xy[:, 0])
    ).tolist()
    none = seen.positions._replace(xy=np.full_like(seen.positions.xy, np.nan))
    panels = [
        panel._replace(pointed=np.full_like(panel.pointed, np.nan), places=[[] for _ in panel.places])
        for panel in seen.panels
    ]
    write_page(tmp_path / "none.html", seen._replace(positions=none, panels=panels))
    assert not any(words in key(tmp_path / "none.html") for words in WORDS)
    assert shown.timed


def test_the_film_has_them(seen: View) -> None:
    panel = seen.panels[0]
    k = next(k for k, some in enumerate(panel.places) if some and np.isfinite(panel.pointed[k]).all())
    alone = seen._replace(panels=[panel])
    frame = [one.copy() for one in pictures(alone)][k]
    nothing = seen.positions._replace(xy=np.full_like(seen.positions.xy, np.nan))
    bare = (
        alone._replace(positions=nothing),
        alone._replace(panels=[panel._replace(pointed=np.full_like(panel.pointed, np.nan))]),
        alone._replace(panels=[panel._replace(places=[[] for _ in panel.places])]),
    )
    for without in bare:
        assert ([one.copy() for one in pictures(without)][k] != frame).any()


def test_one_coordinate_alone_is_a_line_across(seen: View, tmp_path: Path) -> None:
    xy = seen.positions.xy.copy()
    k = int(np.flatnonzero(np.isfinite(xy[:, 0]))[-1])
    xy[k, 1] = np.nan
    ellipse = seen.positions.ellipse.copy()
    ellipse[k] = np.nan
    one = seen._replace(positions=seen.positions._replace(xy=xy, ellipse=ellipse))
    write_page(tmp_path / "line.html", one)
    found = re.search(r'class="positions" d="([^"]*)"', (tmp_path / "line.html").read_text(encoding="utf-8"))
    assert found is not None
    assert re.search(r"M\d+ 0V9999$", found[1])
    drawn, before = ([f.copy() for f in pictures(v._replace(panels=v.panels[:1]))][k] for v in (one, seen))
    assert (drawn != before).any()


def test_a_recording_for_rerun_has_them(seen: View, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: slamduel[replay] has it")
    rerun.write_rrd(tmp_path / "a.rrd", seen)
    content = (tmp_path / "a.rrd").read_bytes()
    for name in ("/known/positions", "/backends/ekf/heading", "/backends/smoother/open-landmarks"):
        assert name.encode() in content


@pytest.mark.slow
def test_the_script_draws_what_stands_there_without_it(browser: Any, seen: View, tmp_path: Path) -> None:
    write_page(tmp_path / "page.html", seen)
    read = "[...document.querySelectorAll('.run path')].map(path => path.getAttribute('d'))"
    still = browser.new_page(java_script_enabled=False)
    still.goto((tmp_path / "page.html").as_uri())
    stills = [path.get_attribute("d") for path in still.locator(".run path").all()]
    tab = browser.new_page()
    said: list[str] = []
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.goto((tmp_path / "page.html").as_uri())
    assert tab.evaluate(read) == stills
    path = "name => document.querySelector(`.run path.${name}`).getAttribute('d')"
    tab.keyboard.press("Home")
    for k in range(len(seen.steps)):
        measured = int(np.isfinite(seen.positions.xy[: k + 1, 0]).sum())
        assert tab.evaluate(path, "positions").count("z") == measured
        assert bool(tab.evaluate(path, "position")) == (measured > 0)
        panel = seen.panels[0]
        assert bool(tab.evaluate(path, "pointed")) == bool(np.isfinite(panel.pointed[k]).all())
        assert tab.evaluate(path, "open").count("M") == sum(len(pieces(line)) for line in panel.places[k])
        tab.keyboard.press("ArrowRight")
    assert said == []
    still.close()
    tab.close()
