"""Figures: that they hold what they say, where a page is told it is, for a few backends and for a crowd."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from slamduel.bench.drawing.figure import GROUPS, Plot, ReportFigure
from slamduel.bench.drawing.svg import alone, on_page
from slamduel.bench.report.drawn_log import DrawnLog, drawn_log
from slamduel.bench.report.figures import report_figures
from slamduel.bench.report.path_figures import PANEL, trajectories
from slamduel.bench.verdict.statistics import compare
from slamduel.bench.verdict.summary import Line, lines
from slamduel.bench.words.names import tags
from slamduel.bench.words.styles import Look, looks
from slamduel.core.se2 import Array
from small_record import Record

LONG = "isam2[relinearize_skip=10,relinearize_threshold=0.1]"
CROWD = (
    ("dead-reckoning", ""), ("ekf", ""), ("ekf", "update=joint"), ("ukf", ""), ("invariant-ekf", ""), ("fixed-lag", ""),
    ("isam2", ""), ("isam2", "relinearize_skip=10,relinearize_threshold=0.1"), ("graph", ""),
    ("fastslam", "particles=100"), ("fastslam", "particles=1000,version=2"), ("fastslam", "particles=100,version=2"),
)  # fmt: skip
STEPS = 240


class Drawn(NamedTuple):
    """A dataset's figures."""

    log: DrawnLog
    lines: Sequence[Line]
    looks: Mapping[str, Look]
    panels: Sequence[ReportFigure]
    figures: Sequence[ReportFigure]

    def named(self, name: str) -> ReportFigure:
        (found,) = [figure for figure in self.figures if figure.name == f"x-{name}"]
        return found


def add(record: Record, backend: str, options: str, seed: int, rng: np.random.Generator) -> None:
    """A cell with all that figures show."""
    paths = ("final",) if backend == "graph" else ("online", "final") if backend == "isam2" else ("online",)
    off = 0.5 if backend == "dead-reckoning" else 0.1 + 0.02 * len(options) / 10
    growth: dict[str, Any] = {"growth_steps": 0.5, "growth_landmarks": 1.2, "nis": 1.0}
    row = record.cell("room", "truth", backend, options, seed, off=off, steps=STEPS, paths=paths, **growth)
    more: dict[str, Any] = {"mapped": 1 + np.arange(STEPS) // 20, "nis": rng.chisquare(4, STEPS)}
    more["nis_dof"] = np.full(STEPS, 4)
    if backend == "fastslam":
        more |= {"n_eff": rng.uniform(40, 100, STEPS), "ancestors": np.linspace(100, 1, STEPS).round()}
    (kept,) = [found for found in record.store.cells() if found.key == tuple(row[name] for name in KEY)]
    record.put(row, record.store.arrays(kept) | more)


KEY = ("dataset", "dataset_options", "backend", "options", "seed")


def draw(folder: Path, backends: Sequence[tuple[str, str]], seeds: int) -> Drawn:
    record, rng = Record(folder), np.random.default_rng(3)
    for backend, options in backends:
        for seed in range(seeds):
            add(record, backend, options, seed, rng)
    record.failed("room", "truth", "ekf", "timeout", "after 1 s", seed=seeds - 1)
    record.log("room", "truth", seeds - 1, steps=STEPS)
    found = lines(record.store.cells())
    look = looks(line.backend for line in found)
    comparisons = {
        column: compare({line.backend: line.by_log(column) for line in found if column in line.values})
        for column in ("ate_m", "final_ate_m")
    }
    shown = drawn_log(record.store, found, look, record.store.run()["folders"], comparisons)
    record.store.close()
    assert shown is not None
    return Drawn(shown, found, look, [*trajectories("p", shown)], report_figures("x", shown))


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Drawn:
    return draw(
        tmp_path_factory.mktemp("few") / "r", [CROWD[k] for k in (0, 1, 6, 8, 9)], 7
    )  # isam2 and graph have final paths


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Drawn:
    return draw(tmp_path_factory.mktemp("crowd") / "r", CROWD, 2)


def test_there_is_a_figure_for_all_that_the_record_has(few: Drawn) -> None:
    accuracy = ["pareto", "paths", "seeds", "pairs", "error", "heading"]
    cost = ["cost", "cost-along", "growth-steps", "growth-landmarks"]
    names = [*accuracy, "nees", "nis", *cost, "effective", "ancestors"]
    assert [figure.name for figure in few.figures] == [f"x-{name}" for name in names]
    assert len(few.panels) == 5
    groups = [GROUPS.index(figure.group) for figure in few.figures]
    assert groups == sorted(groups)
    assert set(groups) == set(range(len(GROUPS)))


def shapes(svg: str, look: Look) -> list[Array]:
    """What belongs to a backend: its lines, (n, 2) corners each, a marker being a line of one."""
    root = ElementTree.fromstring(svg)
    space = root.tag.removesuffix("svg")
    found: list[Array] = []
    for group in (g for g in root.iter(f"{space}g") if g.get("class") == f"of-{look.place}"):
        inside_marks = {path for defs in group.iter(f"{space}defs") for path in defs.iter(f"{space}path")}
        for path in group.iter(f"{space}path"):
            if path not in inside_marks:
                for piece in re.split("(?=M)", path.get("d") or "")[1:]:
                    numbers = [float(number) for number in re.findall(r"-?[\d.]+", piece)]
                    found.append(np.array(numbers).reshape(-1, 2))
        found += [np.array([[float(use.get(axis) or 0) for axis in "xy"]]) for use in group.iter(f"{space}use")]
    return found


def away(point: Array, line: Array) -> float:
    """How far a point is from a line."""
    start, step = line, np.diff(line, axis=0, append=line[-1:])
    along = np.clip(((point - start) * step).sum(1) / np.maximum((step**2).sum(1), 1e-12), 0, 1)
    return float(np.hypot(*(start + along[:, None] * step - point).T).min())


def place(plot: Plot, x: Array, y: Array) -> Array:
    """Where points are in the picture: what a page does with a plot."""
    left, top, right, bottom = plot.box
    shares = []
    for axis, values in ((plot.x, x), (plot.y, y)):
        low, high, at = (np.log(v) if axis.log else v for v in (axis.low, axis.high, values))
        shares.append((at - low) / (high - low))
    return np.column_stack((left + shares[0] * (right - left), bottom + shares[1] * (top - bottom)))


@pytest.mark.slow
def test_a_page_finds_every_point_where_it_is_drawn(few: Drawn, crowd: Drawn) -> None:
    for drawn in (few, crowd):
        for figure in (*drawn.figures, *drawn.panels):
            assert figure.plot is not None
            checked = 0
            for curve in figure.plot.curves:
                lines_ = shapes(figure.svg, drawn.looks[curve.label])
                with np.errstate(invalid="ignore", divide="ignore"):
                    points = place(figure.plot, np.array(curve.x), np.array(curve.y))
                left, top, right, bottom = figure.plot.box
                inside = (points >= (left, top)).all(1) & (points <= (right, bottom)).all(1)
                assert len(points) <= 300
                for point in points[inside][::17]:
                    assert min(away(point, line) for line in lines_) < 0.5, (figure.name, curve.label, point)
                    checked += 1
            assert checked, figure.name


def test_every_backend_in_a_figure_can_be_raised(few: Drawn, crowd: Drawn) -> None:
    for drawn in (few, crowd):
        called = tags(drawn.looks)
        for figure in (*drawn.figures, *drawn.panels):
            for label in {curve.label for curve in figure.plot.curves}:
                assert f'class="of-{drawn.looks[label].place}"' in figure.svg, (figure.name, label)
            root = ElementTree.fromstring(figure.svg)
            space = root.tag.removesuffix("svg")
            marked = {text for g in root.iter(f"{space}g") if g.get("class") for text in g.iter(f"{space}text")}
            names = set(called.values()) | {f"{name}*" for name in called.values()}
            for text in root.iter(f"{space}text"):
                assert text in marked or text.text not in names, (figure.name, text.text)


def test_nothing_sticks_out_of_a_figure(few: Drawn, crowd: Drawn) -> None:
    from slamduel.bench.drawing.svg import drawn as drawn_svg

    drawn_panels = few.panels[0], crowd.panels[7]
    for figure in (few.named("pareto"), *crowd.figures[::2], *drawn_panels):
        assert isinstance(figure.printed, partial)
        width, height, fill = figure.printed.args
        _, again = drawn_svg("again", width, height, fill)
        assert width == (PANEL if figure in drawn_panels else 252)
        (left, bottom), (right, top) = 72 * again.get_tightbbox().get_points()
        assert min(left, bottom, width - right, height - top) > -1, figure.name


def test_many_backends_do_not_eat_the_plot(crowd: Drawn) -> None:
    for figure in crowd.figures:
        left, top, right, bottom = figure.plot.box
        assert right - left > 170
        assert bottom - top > 95
        assert len(figure.svg) < 70_000
        if figure.plot.timed and len({curve.label for curve in figure.plot.curves}) > 7:
            assert " others, faint" in figure.svg
            assert top < 65
            assert ">dead-reckoning<" in figure.svg


def test_names_of_backends_are_as_short_as_they_can_be() -> None:
    alike = ["ekf", "fastslam[particles=100,version=2]", "fastslam[particles=9,version=2]", LONG, "fixed-lag[lag=5]"]
    short = ["ekf", "fastslam[particles=100]", "fastslam[particles=9]", "isam2", "fixed-lag"]
    assert list(tags(alike).values()) == short
    assert tags(["isam2", LONG]) == {"isam2": "isam2", LONG: LONG}


def test_names_stand_beside_their_points_and_not_on_each_other() -> None:
    from matplotlib.figure import Figure

    from slamduel.bench.drawing.labels import Point, name_points

    rng = np.random.default_rng(5)
    figure = Figure((3.5, 2.8))
    axes = figure.subplots()
    names = [f"backend-{'x' * int(k)}" for k in rng.integers(0, 14, 12)]
    points = [Point(float(rng.normal(0, 1)), float(rng.normal(0, 0.3)), name, "of-0") for name in names]
    axes.plot([p.x for p in points], [p.y for p in points], "o", markersize=6)
    axes.set(xlim=(-2.5, 2.5), ylim=(-1, 1))
    name_points(figure, axes, points)
    boxes = [text.get_window_extent() for text in axes.texts if text.get_text()]
    room = axes.get_window_extent()
    assert len(boxes) == 12
    for box in boxes:
        assert room.padded(1).contains(box.x0, box.y0)
        assert room.padded(1).contains(box.x1, box.y1)
    for one, other in combinations(boxes, 2):
        assert not one.padded(-0.5).overlaps(other.padded(-0.5))
    for x, y in axes.transData.transform([(p.x, p.y) for p in points]):
        assert not any(box.contains(x, y) for box in boxes)


def test_the_paper_has_the_same_figure(few: Drawn) -> None:
    figure = few.named("error")
    assert figure.printed is not None
    pdf, png = figure.printed("pdf"), figure.printed("png")
    assert pdf == figure.printed("pdf")
    assert pdf.startswith(b"%PDF")
    found = re.search(rb"/MediaBox\s*\[\s*0 0 ([\d.]+)", pdf)
    assert float(found[1]) == 252
    assert png.startswith(b"\x89PNG")
    assert int.from_bytes(png[16:20], "big") == 1050  # 3.5 inches at 300 dpi
    for text in (on_page(figure.svg), alone(figure.svg)):
        assert not re.search("#0[1-9]0[1-9]0[1-9]", text)


def test_nees_has_a_band_over_logs_and_none_along_one(few: Drawn, tmp_path: Path) -> None:
    over = few.named("nees")
    assert "7 independent logs" in over.caption
    assert over.caption.endswith("by it, dead-reckoning, ekf, fastslam and isam2 are consistent.")
    one = next(curve for curve in over.plot.curves if curve.label == "dead-reckoning")
    runs = few.log.nees["dead-reckoning"]
    assert len(runs) == 7
    mean = np.mean([nees for _, nees in runs], axis=0) / 3
    assert np.nanmean(one.y) == pytest.approx(mean.mean(), rel=0.02)
    alone_ = draw(tmp_path / "r", [("ekf", ""), ("ukf", "")], 1)
    along = alone_.named("nees")
    assert "No band" in along.caption
    assert "opacity: 0.12" not in along.svg
    assert "opacity: 0.12" in over.svg


def test_the_best_is_the_measure_of_the_others(few: Drawn) -> None:
    figure = few.named("pairs")
    by_log = {line.backend: line.by_log("ate_m") for line in few.lines if "ate_m" in line.values}
    medians = {label: float(np.median(list(errors.values()))) for label, errors in by_log.items()}
    best = min(medians, key=lambda label: medians[label])
    assert best in figure.title
    assert {curve.label for curve in figure.plot.curves} == set(by_log) - {best}
    for curve in figure.plot.curves:
        ratios = [by_log[curve.label][log] / by_log[best][log] for log in by_log[best]]
        finite = [ratio for ratio in ratios if np.isfinite(ratio)]
        assert curve.x[0] == pytest.approx(np.median(ratios), rel=0.05) or len(finite) < len(ratios)


def test_a_single_comparison_is_a_sentence(few: Drawn) -> None:
    """Two backends have final paths: below the figure of the online ones it is said how they compare."""
    assert "Final paths: " in few.named("pairs").caption


def test_the_log_nearest_to_the_medians_is_drawn(tmp_path: Path) -> None:
    record = Record(tmp_path / "r")
    for seed, (ekf, isam2) in enumerate([(4.0, 1.0), (1.0, 4.0), (1.1, 1.0), (0.5, 0.9), (1.0, 1.0)]):
        record.cell("room", "truth", "ekf", seed=seed, ate_m=ekf)
        record.cell("room", "truth", "isam2", seed=seed, ate_m=isam2)
        if seed < 4:  # medians are 1 and 1; on the last log, which has both, one backend is not done
            record.cell("room", "truth", "dead-reckoning", seed=seed, ate_m=100.0 * (seed == 2) + 1)
    found = lines(record.store.cells())
    shown = drawn_log(record.store, found, looks(line.backend for line in found), record.store.run()["folders"])
    record.store.close()
    assert (shown.seed, shown.which) == (2, "seed 2, the log nearest to the medians")


def test_no_point_is_outside_the_frame_however_accurate(tmp_path: Path) -> None:
    record = Record(tmp_path / "r")
    record.cell("park", "reference", "ekf", ate_m=100.0)
    record.cell("park", "reference", "isam2", paths=("online", "final"), ate_m=4.0, final_ate_m=1e-6)
    found = lines(record.store.cells())
    look = looks(line.backend for line in found)
    shown = drawn_log(record.store, found, look, record.store.run()["folders"])
    record.store.close()
    assert shown is not None
    assert shown.which == ""
    pareto = report_figures("x", shown)[0]
    assert pareto.plot.y.low < 1e-6 < 100 < pareto.plot.y.high
    assert "better" not in pareto.caption


def test_nis_has_a_band_over_logs(few: Drawn) -> None:
    """Chi-square's with four degrees of freedom a step: 5 % of stretches are outside."""
    (plot,) = [figure for figure in few.figures if figure.name == "x-nis"]
    assert "7 independent logs" in plot.caption
    assert "opacity: 0.12" in plot.svg
    (one,) = [curve for curve in plot.plot.curves if curve.label == "isam2"]
    wide = 1.96 * np.sqrt(2 / (4 * 7 * STEPS / len(one.x)))
    assert np.mean(np.abs(np.array(one.y) - 1) > wide) < 0.2
    assert np.mean(one.y) == pytest.approx(1, abs=3 * wide / np.sqrt(len(one.x)))


def test_what_failed_is_counted(few: Drawn) -> None:
    assert "1 of 7 not done" in few.named("seeds").svg
    assert "What failed counts as the worst." in few.named("seeds").caption


def test_error_and_growth_are_those_of_the_record(few: Drawn) -> None:
    error, heading, growth = (few.named(name).plot for name in ("error", "heading", "growth-landmarks"))
    trace = next(trace for trace in few.log.traces if trace.label == "isam2")
    for plot, path, final in ((error, "aligned", False), (error, "final_aligned", True), (heading, "aligned", False)):
        (curve,) = [c for c in plot.curves if c.label == "isam2" and c.final == final]
        off = trace.arrays[path] - few.log.known["poses"]
        wrapped = (off[:, 2] + np.pi) % (2 * np.pi) - np.pi
        squared = (off[:, :2] ** 2).sum(1) if plot is error else np.degrees(wrapped) ** 2
        assert np.sqrt(np.mean(np.square(curve.y))) == pytest.approx(np.sqrt(squared.mean()), rel=0.05)
    (curve,) = [c for c in growth.curves if c.label == "isam2"]
    assert curve.x == sorted(curve.x)
    assert (curve.x[0], curve.x[-1]) == (1, 11.5)  # the mean of the last bin
    us = trace.arrays["step_ns"][trace.arrays["mapped"] >= 11] / 1e3
    assert curve.y[-1] == pytest.approx(us.mean(), rel=1e-3)
    assert "∝ N¹·²" in few.named("growth-landmarks").svg


def test_growth_of_a_long_log_has_its_slope_where_the_map_is_whole_and_the_deadlines(tmp_path: Path) -> None:
    record, rng, steps = Record(tmp_path / "r"), np.random.default_rng(5), 2000
    for backend, exponent in (("smoother", 0.7), ("ekf", 0.0)):
        more: dict[str, Any] = {
            "slope_steps": exponent,
            "slope_steps_low": exponent - 0.1,
            "whole_from": 240,
            "slope_from": 240,
        }
        row = record.cell("room", "truth", backend, steps=steps, slope_steps_high=exponent + 0.1, **more)
        (kept,) = [found for found in record.store.cells() if found.key[2] == backend]
        ns = 1e4 * np.arange(1, steps + 1) ** exponent * rng.lognormal(0, 0.1, steps)
        record.put(row, record.store.arrays(kept) | {"step_ns": ns.astype(np.int64)})
    found = lines(record.store.cells())
    shown = drawn_log(record.store, found, looks(line.backend for line in found), record.store.run()["folders"])
    record.store.close()
    assert shown is not None
    (growth,) = [figure for figure in report_figures("x", shown) if figure.name == "x-growth-steps"]
    assert "smoother, ∝ k⁰·⁷ (0.6 to 0.8)" in growth.svg
    assert "ekf, flat" in growth.svg
    assert "map whole" in growth.svg
    assert "Dashed: step 240" in growth.caption
    assert "1 ms" in growth.svg
    assert "10 ms" not in growth.svg  # no step takes as long
