"""`bench speed --frontend --only markers`: what it measures, and what it writes."""

from pathlib import Path

import numpy as np
import pytest

from csv_rows import csv_rows
from slamduel.bench.cli import main
from slamduel.bench.front_ends import study as frontend
from slamduel.bench.front_ends.corners import Accuracy, CornerExtent, Cost, Misreadings, Study, errors_in, steps
from slamduel.bench.front_ends.study import COLUMNS
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.marker_shots import Placement, placements
from slamduel.frontend.markers.aruco import Detector
from slamduel.frontend.markers.markers import Markers

CAMERA = CAMERAS["pinhole"]
STUDY = Study(refinements=("none", "template"))


def test_errors_are_what_was_found_less_the_truth() -> None:
    """Moving the truth by a centimetre along the line of sight moves the error by as much the other way."""
    (shot,) = placements(CAMERA, 1.5, 1, np.random.default_rng(1), samples=4)
    detector = Detector(Markers("4X4_50", 0.16), CAMERA)
    farther = shot.pose.copy()
    farther[:3, 3] *= 1.51 / 1.5
    ((error, _, nse),), _ = errors_in(detector, shot)
    ((less, _, worse),), _ = errors_in(detector, shot._replace(pose=farther))
    assert error - less == pytest.approx(0.01)
    assert worse > nse + 100
    assert errors_in(detector, Placement((shot.id + 1) % 50, shot.pose, shot.image)) == ([], 1)


def test_a_distance_has_a_row_for_every_refinement() -> None:
    none, template = STUDY.accuracy(2.0, 0.0, 8, lambda: None)
    assert (none.refinement, template.refinement) == ("none", "template")
    assert template.found >= 7
    assert template.wrong == 0
    assert abs(template.bias) < abs(none.bias)
    assert template.sd < none.sd
    seen = list[None]()
    again = STUDY.accuracy(2.0, 0.0, 8, lambda: seen.append(None))[1]
    assert again == template
    assert len(seen) == 8


def test_too_few_found_have_no_figures() -> None:
    _, (row) = STUDY.accuracy(14.0, 0.0, 2, lambda: None)  # 6 px
    assert row.found == 0
    assert np.isnan(row.bias)


def test_costs_and_misreadings_have_every_frame() -> None:
    extent, seen = CornerExtent(2, 0, 3, 2), list[None]()
    costs = list(STUDY.costs(extent.timed, lambda: seen.append(None)))
    assert [(c.refinement, c.camera.width) for c in costs] == [
        ("none", 640),
        ("template", 640),
        ("none", 1280),
        ("template", 1280),
    ]
    assert all(c.ms > 0 and c.rate == pytest.approx(1000 / c.ms) for c in costs)
    rows = list(STUDY.misreadings(extent, lambda: seen.append(None)))
    assert [(r.kind, r.frames) for r in rows] == [("clutter", 3)] * 2 + [("six markers", 2)] * 2
    assert rows[-1].sightings >= 10
    assert all(r.wrong == 0 for r in rows)
    assert len(seen) == steps(extent)


def test_the_command_prints_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks: list[int] = []

    class Little(Study):
        def costs(self, frames: int, progress: object) -> list[Cost]:  # pyright: ignore[reportIncompatibleMethodOverride]
            ticks.append(frames)
            return [Cost("none", CAMERA, frames, 8.0), Cost("template", CAMERA, frames, 12.0)]

        def accuracy(self, distance: float, streak: float, count: int, progress: object) -> list[Accuracy]:
            worse = Accuracy("none", distance, streak, count, count, 0, 0.02 * distance, 0.01, 1e-4, 9.0, 1.0)
            missed = Accuracy("template", distance, streak, count, 1, 0, *[np.nan] * 5)
            good = Accuracy("template", distance, streak, count, count, 0, 1e-4 * distance, 1e-3, -1e-5, 2.1, 0.2)
            return [worse, missed if distance == 6 else good]

        def misreadings(self, extent: CornerExtent, progress: object) -> list[Misreadings]:  # pyright: ignore[reportIncompatibleMethodOverride]
            return [Misreadings("clutter", "template", extent.clutter, 0, 0)]

    monkeypatch.setattr(frontend, "Study", Little)
    out, table = tmp_path / "out", tmp_path / "t.csv"
    arguments = ["--frontend", "--only", "markers", "--quick", "--clutter", "7", "--csv", str(table), "--out", str(out)]
    assert main(["speed", *arguments]) == 0
    said = capsys.readouterr().out
    for words in ("640x480, ms", "1.50", "83", "+2.000", "2.10 ± 0.20", "a camera that moves", "wrong ids", "wrote: "):
        assert words in said
    assert ticks == [10]
    assert table.read_text() == (out / "frontend.csv").read_text()
    assert (out / "frontend.png").read_bytes().startswith(b"\x89PNG")
    rows = csv_rows(table)
    assert tuple(rows[0]) == COLUMNS
    assert [row["study"] for row in rows] == ["cost"] * 2 + ["still"] * 14 + ["moving"] * 8 + ["clutter"]
    assert rows[-1]["frames"] == "7"
    assert rows[2]["bias_m"] == "0.01"
    blank = [row for row in rows if row["distance_m"] == "6.0" and row["refinement"] == "template"]
    assert [row["nees"] for row in blank] == [""]
    assert sorted(path.name for path in out.iterdir()) == ["frontend.csv", "frontend.png"]
