"""`bench speed --frontend --only cameras`: the same markers before every camera, and what is written of them."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from csv_rows import csv_rows
from slamduel.bench.cli import main
from slamduel.bench.front_ends import study as frontend
from slamduel.bench.front_ends.cameras import DISTANCES, EFFECTS, PACE, CameraAccuracy, CameraStudy, Effect
from slamduel.bench.front_ends.corners import Accuracy
from slamduel.bench.front_ends.study import COLUMNS
from slamduel.datasets.rendering.sensor import IDEAL, SENSORS, Sensor
from slamduel.datasets.rendering.sheet import PERFECT, Print


def test_ink_that_spreads_brings_markers_nearer_and_nothing_else_differs() -> None:
    """Black that is wider by 1 % of the side at each edge is a square 2 % larger, and as much nearer."""
    study = CameraStudy(effects=(Effect("ideal"), Effect("again"), Effect("ink", prints=Print(ink=0.01))))
    seen = list[None]()
    rows = study.accuracy(1.0, 6, lambda: seen.append(None))
    assert len(seen) * len(DISTANCES) == 6 * study.steps
    subpix = {row.camera: row.accuracy for row in rows if row.accuracy.refinement == "subpix"}
    assert [(row.camera, row.accuracy.refinement) for row in rows[:2]] == [("ideal", "subpix"), ("ideal", "template")]
    assert subpix["ideal"] == subpix["again"]
    assert subpix["ideal"].found == subpix["ink"].found == 6
    assert subpix["ideal"].refused == 0
    assert subpix["ink"].bias - subpix["ideal"].bias == pytest.approx(1 / 1.02 - 1, rel=0.15)


def test_times_of_a_sensor_are_motion_in_the_image() -> None:
    webcam = Effect("webcam", SENSORS["webcam"])
    assert (webcam.streak, webcam.skew) == (2.0, 0.0)
    assert Effect("shutter", Sensor(readout=0.03)).skew == pytest.approx(0.03 * PACE)


def test_a_rolling_shutter_that_is_modelled_is_as_good_as_none() -> None:
    shutter = Effect("rolling", Sensor(readout=0.03))
    ignored = shutter._replace(name="ignored", modelled=False)
    rows = CameraStudy(effects=(shutter, ignored)).accuracy(2.0, 8, lambda: None)
    nees = {row.camera: row.accuracy.nees for row in rows if row.accuracy.refinement == "template"}
    assert nees["rolling"] < 3
    assert nees["ignored"] > 100


def test_each_effect_is_measured_alone_and_the_cameras_whole() -> None:
    assert EFFECTS[0] == Effect("ideal")
    assert len({effect.name for effect in EFFECTS}) == len(EFFECTS)
    assert [effect.name for effect in EFFECTS[-3:]] == ["phone", "webcam", "industrial"]
    for effect in EFFECTS[1:-3]:
        plain, own = asdict(IDEAL) | asdict(PERFECT), asdict(effect.sensor) | asdict(effect.prints)
        assert sum(own[name] != plain[name] for name in plain) == 1, effect.name


def test_the_command_prints_and_writes_every_camera(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Little(CameraStudy):
        def accuracy(self, distance: float, count: int, progress: object) -> list[CameraAccuracy]:
            good = Accuracy("template", distance, 0.0, count, count, 0, 1e-4 * distance, 1e-3, -1e-5, 2.1, 0.2)
            missed = Accuracy("template", distance, 0.0, count, 1, 0, *[np.nan] * 5)
            rough = good._replace(refinement="subpix", bias=0.02 * distance)
            return [CameraAccuracy("ideal", rough), CameraAccuracy("ideal", good), CameraAccuracy("phone", missed)]

    monkeypatch.setattr(frontend, "CameraStudy", Little)
    out, table = tmp_path / "out", tmp_path / "t.csv"
    arguments = ["--frontend", "--only", "cameras", "--placements", "10", "--csv", str(table), "--out", str(out)]
    assert main(["speed", *arguments]) == 0
    said = capsys.readouterr().out
    for words in ("10 placements 4 m away", "refused", "90.0 %", "+2.000", "2.10 ± 0.20", "wrote: "):
        assert words in said
    assert "CPU time" not in said
    assert sorted(path.name for path in out.iterdir()) == ["cameras.png", "frontend.csv"]
    assert (out / "cameras.png").read_bytes().startswith(b"\x89PNG")
    rows = csv_rows(table)
    assert tuple(rows[0]) == COLUMNS
    assert [row["study"] for row in rows] == ["cameras"] * 12
    assert [row["camera"] for row in rows[:3]] == ["ideal", "ideal", "phone"]
    assert (rows[2]["sightings"], rows[2]["nees"]) == ("1", "")
