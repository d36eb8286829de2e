"""Occupancy grids of a run on a laser log: in the report, and as the files of bench map."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from command import refused
from slamduel import run
from slamduel.bench.cli import main
from slamduel.bench.record.beside_arrays import kept_beside, kept_name
from slamduel.bench.record.store import Store
from slamduel.core.beside import columns_of

DATASET = "laser-floor[laps=0.15,people=0]"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run") / "out"
    run(DATASET, ["dead-reckoning", "graph"], seeds=1, out=out)
    return out


def test_the_report_has_a_grid_for_each_backend(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert "Occupancy grids" in page
    assert page.count("data:image/png;base64") == 2
    assert "img-src data:" in page
    assert sorted(file.name for file in (folder / "figures").glob("*-grid-*.svg"))


def test_bench_map_writes_a_map_for_ros(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", str(folder), "--out", str(tmp_path), "--cell", "0.1"]) == 0
    said = capsys.readouterr().out
    assert said.count("cells of 0.1 m") == 2
    places = sorted(file.parent for file in tmp_path.rglob("grid.yaml"))
    assert [place.name for place in places] == ["dead-reckoning", "graph"]
    for place in places:
        words = dict(line.split(": ", 1) for line in (place / "grid.yaml").read_text().splitlines())
        assert words["image"] == "grid.pgm"
        assert float(words["resolution"]) == 0.1
        x, y, turn = (float(one) for one in words["origin"].strip("[]").split(","))
        pixels = cv2.imread(str(place / "grid.pgm"), cv2.IMREAD_UNCHANGED)
        assert pixels is not None
        assert set(np.unique(pixels)) == {0, 205, 254}
        assert turn == 0.0
        height, _ = pixels.shape
        with Store(folder) as store:  # the robot's start is free ground
            start = next(iter(store.cells()))
            online = store.arrays(start, ("online",))["online"][0]
        row, column = height - 1 - int((online[1] - y) / 0.1), int((online[0] - x) / 0.1)
        assert pixels[row, column] == 254
        picture = cv2.imread(str(place / "grid.png"), cv2.IMREAD_GRAYSCALE)
        assert picture.shape == pixels.shape


@pytest.mark.usefixtures("no_report")
def test_without_scans_there_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("circle[steps=50]", ["dead-reckoning"], seeds=1, out=tmp_path / "plain")
    said = refused(capsys, "map", tmp_path / "plain")
    assert "no cell with laser scans or clouds of a depth camera beside its log is done, expected" in said


def test_scans_of_another_log_are_none(folder: Path) -> None:
    with Store(folder) as store:
        row = next(iter(store.cells()))
        scans = store.scans(row)
    assert scans is not None
    arrays = {kept_name("scans", name): column for name, column in columns_of("scans", scans).items()}
    assert set(arrays) >= {"scan_step", "scan_ranges", "scan_scanner"}  # as in records of earlier versions
    steps = int(scans.at.step.max()) + 1
    assert kept_beside("scans", arrays, steps) is not None
    assert kept_beside("scans", arrays, steps - 1) is None
    assert kept_beside("clouds", arrays, steps) is None
    assert kept_beside("scans", {name: one for name, one in arrays.items() if name != "scan_step"}, steps) is None
    assert kept_beside("scans", arrays | {"scan_ranges": arrays["scan_ranges"][:, 1:]}, steps) is None
