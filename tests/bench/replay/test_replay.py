"""A run lived through again: the same paths bit for bit, maps as they grew, and files that say so and are whole."""

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import command
import pages
from random_logs import random_log
from slamduel.bench.cli import main
from slamduel.bench.record.store import Store
from slamduel.bench.replay import rerun
from slamduel.bench.replay import view as view_module
from slamduel.bench.replay.replay import Replay, choose, replay
from slamduel.bench.replay.view import View, ellipses, view
from slamduel.datasets.formats import log_folder
from small_record import edited, put

STEPS, FRAMES = 40, 14
BACKENDS = "ekf,graph,misbehaving:raises,oracle_backends:true_poses"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a filter, a batch method, a backend that raises at its fifth step, and one that is told the truth."""
    base = tmp_path_factory.mktemp("replay")
    log_folder.write(base / "wander", *random_log(np.random.default_rng(1), STEPS, 8))
    words = ["--backend", BACKENDS, "--dataset", str(base / "wander"), "--seeds", "1", "--oracle"]
    with pytest.MonkeyPatch.context() as patch:
        pages.left_out(patch)
        assert main(["run", "--quiet", *words, "--out", str(base / "run")]) == 1  # of which one raises
    return base / "run"


def again(folder: Path, **named: Any) -> Replay:
    with Store(folder) as store:
        return replay(store, choose(store, None, named.get("backends"), None), FRAMES, 2)


@pytest.fixture(scope="module")
def shown(folder: Path) -> Replay:
    return again(folder)


@pytest.fixture(scope="module")
def seen(shown: Replay) -> View:
    return view(shown)


def recorded(folder: Path, backend: str) -> dict[str, Any]:
    with Store(folder) as store:
        return next(store.arrays(row) for row in store.cells() if row.columns["backend"] == backend)


def test_a_way_too_long_to_be_thinned_is_drawn_as_the_last_steps_before_each_frame(
    shown: Replay, seen: View, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not seen.pieces
    monkeypatch.setattr(view_module, "TRAIL", 20)  # points, of 40 steps
    assert not view(shown).pieces  # the robot goes little from one to the next
    monkeypatch.setattr(view_module, "ACROSS", 1e-6)
    monkeypatch.setattr(view_module, "LAST", 1)
    pieces = view(shown)
    assert pieces.pieces
    drawn = np.atleast_1d(np.isfinite(pieces.truth).all(axis=1))
    whole = np.zeros((len(shown.log.log), 2))
    whole[:] = seen.truth  # every step of it
    assert {tuple(xy) for xy in whole[shown.frames]} <= {tuple(xy) for xy in pieces.truth[drawn]}
    both = drawn[1:] & drawn[:-1]
    steps = [int(np.flatnonzero((whole == xy).all(axis=1))[0]) for xy in pieces.truth[drawn]]
    assert both.any()
    at = np.full(len(drawn), -1)
    at[drawn] = steps
    assert (np.diff(at)[both] == 1).all()  # no line joins what is not next to each other
    assert [at[count - 1] for count in pieces.at] == shown.frames.tolist()  # up to each frame, and no further
    ekf, alone = pieces.panels[0].trail, seen.panels[0].trail
    assert len(ekf) == len(drawn)
    assert np.array_equal(ekf[drawn], alone[steps])


def test_the_paths_and_the_last_map_are_the_recorded_ones(folder: Path, shown: Replay) -> None:
    ekf, graph, _, told = shown.parts
    before = recorded(folder, "ekf")
    assert ekf.course.path.tobytes() == before["online"].tobytes()
    assert ekf.course.maps[-1].ids.tolist() == before["map_ids"].tolist()
    assert ekf.course.maps[-1].xy.tobytes() == before["map_xy"].tobytes()
    assert np.allclose(ekf.course.maps[-1].cov, before["map_cov"], rtol=0, atol=1e-15)
    assert graph.course.path.tobytes() == recorded(folder, "graph")["final"].tobytes()
    assert [ekf.remark, told.remark] == ["", ""]
    assert graph.remark == "no online path: the final one is shown"
    truth = shown.log.truth
    assert told.course.path.tobytes() == truth.poses.tobytes()


def test_the_map_grows_as_landmarks_are_sighted(shown: Replay) -> None:
    log, course = shown.log.log, shown.parts[0].course
    sizes = [len(known.ids) for known in course.maps]
    assert sizes[0] < sizes[-1]
    for k, known in zip(shown.frames, course.maps, strict=True):
        assert set(known.ids.tolist()) == set(log.ids[: log.sighting_first[k + 1]].tolist())


def test_what_raises_is_shown_as_far_as_it_came(shown: Replay, seen: View) -> None:
    part, panel = shown.parts[2], seen.panels[2]
    assert part.remark.startswith("stops after 4 steps: ValueError: ")
    assert len(part.course.path) == 4
    assert len(panel.pose) == len(panel.maps) == sum(shown.frames < 4)
    assert len(panel.pose) > 0


def test_numbers_are_those_of_the_record_and_of_the_log(folder: Path, shown: Replay, seen: View) -> None:
    panel, before, log = seen.panels[0], recorded(folder, "ekf"), shown.log.log
    assert np.allclose(panel.nees, before["nees"][shown.frames] / 3, rtol=1e-9)
    assert panel.step_us.tolist() == (before["step_ns"][shown.frames] / 1e3).tolist()
    truth = shown.log.truth
    off = before["online"] - truth.poses
    assert np.allclose(panel.error, np.sqrt(off[:, 0] ** 2 + off[:, 1] ** 2)[shown.frames])
    k = int(shown.frames[-1])
    assert log.sighting_first[k + 1] > log.sighting_first[k]
    z = log.z[log.sighting_first[k] : log.sighting_first[k + 1]]
    rays = panel.sighted[-1].ends - panel.sighted[-1].origin
    bearing = np.arctan2(rays[:, 1], rays[:, 0]) - panel.pose[-1, 2]
    assert np.allclose(
        np.column_stack((np.hypot(*rays.T), np.sin(bearing))), np.column_stack((z[:, 0], np.sin(z[:, 1])))
    )


def test_an_ellipse_holds_95_percent() -> None:
    cov = np.array([[[2.0, 0.7], [0.7, 0.5]]])
    a, b, angle = ellipses(cov)[0]
    xy = np.random.default_rng(1).multivariate_normal((0, 0), cov[0], 20_000)
    c, s = np.cos(angle), np.sin(angle)
    inside = np.hypot((c * xy[:, 0] + s * xy[:, 1]) / a, (c * xy[:, 1] - s * xy[:, 0]) / b) < 1
    assert abs(inside.mean() - 0.95) < 6 * np.sqrt(0.95 * 0.05 / len(xy))
    assert a > b


def test_another_path_than_the_recorded_one_is_told(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "run")
    with Store(tmp_path / "run", writing=True) as store:
        row = next(row for row in store.cells() if row.columns["backend"] == "ekf")
        arrays = store.arrays(row)
        arrays["online"][7, 0] = np.nextafter(arrays["online"][7, 0], np.inf)
        put(store, row.result, row.columns, arrays)
    (part,) = again(tmp_path / "run", backends="ekf").parts
    assert part.remark.startswith("NOT THE RECORDED PATH: another from step 7 on, by up to ")
    assert main(["replay", str(tmp_path / "run"), "--backend", "ekf", "--quiet"]) == 1


@pytest.mark.parametrize("edit", ["UPDATE arrays SET archive = x'504b00'", "DELETE FROM arrays"])
def test_a_recorded_path_that_cannot_be_read_is_told(
    folder: Path, tmp_path: Path, edit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    edited(shutil.copytree(folder, tmp_path / "run"), f"{edit} WHERE key IN (SELECT key FROM results)")
    assert main(["replay", str(tmp_path / "run"), "--backend", "ekf", "--out", str(tmp_path / "x.html")]) == 1
    assert "ekf: NOT COMPARED: the recorded path is not there, or cannot be read" in capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    return command.refused(capsys, "replay", *words)


def test_another_log_than_the_recorded_one_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = edited(shutil.copytree(folder, tmp_path / "run"), "UPDATE logs SET digest = :digest", digest="f" * 64)
    said = refused(capsys, run, "--out", tmp_path / "x.html")
    assert "has changed since this run" in said
    assert "expected ffffffffffff" in said
    assert os.listdir(tmp_path) == ["run"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--dataset", "room"], "--dataset room: is not in this run, expected log[path="),
        (["--backend", "ekf,isam3"], "--backend isam3: is not in this run, expected one of ekf, graph, "),
        (["--seed", "3"], "--seed 3: this run has no such log of log[path="),
        (["--frames", "1"], "--frames 1: expected a whole number, at least 2."),
        (["--out", "x.avi"], "--out x.avi: found the ending '.avi', expected one of .html, .gif, .mp4, .rrd."),
        (["--out", "no/such/x.gif"], "--out no/such/x.gif: there is no folder no/such, expected an existing one."),
    ],
)
def test_a_wrong_word_is_a_sentence_that_names_what_is_there(
    folder: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(os.listdir(folder))
    assert f"bench: {sentence}" in refused(capsys, folder, *words)
    assert sorted(os.listdir(folder)) == before


@pytest.mark.slow
def test_films_have_every_frame_as_it_was_drawn(seen: View, tmp_path: Path) -> None:
    import cv2
    from PIL import Image, ImageSequence

    from slamduel.bench.replay.film import write_gif, write_mp4
    from slamduel.bench.replay.frames import pictures

    small = seen._replace(panels=seen.panels[:2])
    drawn = [picture[..., ::-1].astype(int) for picture in pictures(small)]
    write_gif(tmp_path / "a.gif", small)
    with Image.open(tmp_path / "a.gif") as film:
        frames = [np.array(frame.convert("RGB"), int) for frame in ImageSequence.Iterator(film)]
    assert len(frames) == len(drawn) == FRAMES
    for frame, picture in zip(frames, drawn, strict=True):
        assert np.abs(frame - picture).max() < 90  # an anti-aliased edge between two lines has no colour of its own
        assert np.abs(frame - picture).mean() < 1
    write_mp4(tmp_path / "a.mp4", small)
    film = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    frames = [film.read()[1][..., ::-1].astype(int) for _ in drawn]
    assert not film.read()[0]
    film.release()
    own = [np.abs(frame - picture).mean() for frame, picture in zip(frames, drawn, strict=True)]
    assert max(own) < 8
    assert own[-1] < np.abs(frames[-1] - drawn[0]).mean()
    assert sorted(os.listdir(tmp_path)) == ["a.gif", "a.mp4"]


def test_a_film_is_whole_or_not_there(seen: View, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from slamduel.bench.replay.film import write_gif

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space"):
        write_gif(tmp_path / "a.gif", seen._replace(panels=seen.panels[:1], steps=seen.steps[:2]))
    assert os.listdir(tmp_path) == []


@pytest.fixture(scope="module")
def page(folder: Path) -> Path:
    """As the command writes it, with nothing said but the folder."""
    assert main(["replay", str(folder), "--frames", str(FRAMES), "--quiet"]) == 0
    (found,) = folder.glob("replay-*-0.html")
    return found


def test_the_page_has_the_map_of_the_end_by_its_changes(page: Path, seen: View) -> None:
    text = page.read_text(encoding="utf-8")
    assert "http" not in text
    run = json.loads(re.findall(r'id="run">(.*?)</script>', text)[0])
    scale = 1000 / (seen.high[0] - seen.low[0])
    for told, panel in zip(run["panels"], seen.panels, strict=True):
        marks: dict[int, list[int]] = {}
        for gone, changed in told["maps"]:
            for slot in gone:
                del marks[slot]
            marks |= {changed[k]: changed[k + 1 : k + 3] for k in range(0, len(changed), 6)}
        places = (panel.maps[-1].xy - (seen.low[0], seen.high[1])) * (scale, -scale)
        found = np.array(sorted(marks.values())).reshape(-1, 2)
        assert len(found) == len(places)
        for place in places:
            assert np.abs(found - place).max(axis=1).min() <= 1.5  # half a unit of rounding, and one that nobody sees


@pytest.mark.slow
def test_the_script_draws_what_stands_there_without_it(browser: Any, page: Path) -> None:
    read = "[...document.querySelectorAll('.run path')].map(path => path.getAttribute('d'))"
    still = browser.new_page(java_script_enabled=False)
    still.goto(page.as_uri())
    stills = [path.get_attribute("d") for path in still.locator(".run path").all()]
    tab = browser.new_page(viewport={"width": 400, "height": 900}, color_scheme="dark")
    said: list[str] = []
    asked: list[str] = []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(page.as_uri())
    assert tab.evaluate(read) == stills
    assert tab.evaluate("document.documentElement.scrollWidth") == 400
    tab.keyboard.press("Home")
    assert tab.locator("#now").inner_text().endswith(f"step 0 of {STEPS - 1}")
    assert tab.evaluate(read) != stills
    tab.keyboard.press("ArrowRight")
    assert tab.locator("#frame").input_value() == "1"
    tab.keyboard.press("Shift+ArrowRight")
    assert tab.locator("#frame").input_value() == "11"
    tab.select_option("#speed", "4")
    tab.locator("#play").click()
    tab.wait_for_function(f"document.getElementById('frame').value == {FRAMES - 1}")
    assert tab.locator("#play").inner_text() == "Play"
    assert tab.evaluate(read) == stills
    assert (said, asked) == ([], [page.as_uri()])
    still.close()
    tab.close()


def test_a_recording_for_rerun(seen: View, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: slamduel[replay] has it")
    rerun.write_rrd(tmp_path / "a.rrd", seen)
    content = (tmp_path / "a.rrd").read_bytes()
    assert content.startswith(b"RRF")
    for name in ("/backends/ekf/landmarks", "/backends/graph/path", "/known/dead-reckoning", "/numbers/nees/ekf"):
        assert name.encode() in content
    assert os.listdir(tmp_path) == ["a.rrd"]


def test_without_rerun_it_says_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(rerun, "find_spec", lambda name: None)
    assert "pip install 'slamduel[replay]'" in refused(capsys, folder, "--out", tmp_path / "a.rrd")
