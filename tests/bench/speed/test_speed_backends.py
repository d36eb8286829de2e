"""`bench speed`: what it measures, how figures are made of that, and what it writes. Nothing here asserts a time."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from csv_rows import csv_rows
from places import SUPPORT
from slamduel.backends.api import Map, NoOptions
from slamduel.backends.gaussian.ekf import Options as EkfOptions
from slamduel.backends.particles.fastslam import Options as FastSlamOptions
from slamduel.bench.cli import main
from slamduel.bench.speed import process
from slamduel.bench.speed.figure import apart, write_figure
from slamduel.bench.speed.isam2_parts import BY_HAND, PARTS, WHOLE, Stopwatch
from slamduel.bench.speed.process import Process, Stretch, Subject, measure
from slamduel.bench.speed.ratios import exponent, growth, ratios, step_of_parts
from slamduel.bench.speed.tables import COLUMNS, as_csv
from slamduel.bench.speed.timing import LEAST, Timing, TimingRow, array_bytes, holds_foreign, stepped, timing
from slamduel.bench.speed.world import NEAREST, ODOMETRY_SD, SIGHTING_SD, world
from slamduel.core.se2 import Array, between, compose, wrap

LITTLE = Stretch(steps=12, sightings=6, seconds=0.5, seed=0, scattered=False)


def flat(us: float) -> Timing:
    return Timing(100, us, us, us, us, us, (us,) * 5)


def test_percentiles_and_fifths_are_those_of_the_steps_in_order() -> None:
    ns = np.arange(1, 101) * 1000
    found = timing(ns)
    assert (found.steps, found.mean, found.p50, found.max) == (100, 50.5, 50.5, 100.0)
    assert found.p95 == pytest.approx(95.05)
    assert found.p99 == pytest.approx(99.01)
    assert found.fifths == pytest.approx((10.5, 30.5, 50.5, 70.5, 90.5))
    assert timing(ns[::-1]).fifths == pytest.approx((90.5, 70.5, 50.5, 30.5, 10.5))


def test_a_run_of_three_steps_has_two_fifths_without_one() -> None:
    found = timing(np.array([1000, 2000, 6000]))
    assert found.fifths[:3] == (1.0, 2.0, 6.0)
    assert np.isnan(found.fifths[3:]).all()


@pytest.mark.parametrize("power", [0.0, 1.0, 2.4])
def test_the_exponent_is_that_of_the_largest_sizes(power: float) -> None:
    sizes = np.array([1000, 10, 300, 30, 100])
    costs = 3.0 * sizes**power
    costs[sizes < 100] = 1e6  # what rules small sizes does not count
    assert exponent(sizes.tolist(), costs.tolist()) == pytest.approx(power, abs=1e-9)


def test_growth_is_that_with_the_most_particles() -> None:
    one = [TimingRow("backend", "ekf", n, timing=flat(n**2.0)) for n in (10, 100)]
    other = [
        TimingRow("backend", "fastslam", n, m, flat(m * n**0.5 if m == 9 else 1.0)) for n in (10, 30) for m in (9, 3)
    ]
    alone = [TimingRow("backend", "ukf", 10, timing=flat(1.0)), TimingRow("backend", "ukf", 30, reason="lost")]
    assert growth([*one, *other, *alone]) == pytest.approx({"ekf": 2.0, "fastslam": 0.5})


def test_one_size_has_no_exponent() -> None:
    assert np.isnan(exponent([10], [3.0]))


@pytest.mark.parametrize("landmarks", [1, 10, 100, 300])
def test_the_survey_sees_every_landmark_and_the_drive_the_nearest(landmarks: int) -> None:
    here = world(landmarks, 40, 6, 3)
    seen = np.unique(np.concatenate([step.sightings.ids for step in here.survey]))
    assert seen.tolist() == list(range(landmarks))
    assert here.survey[0].odometry is None
    assert all(step.odometry is not None for step in here.drive)
    assert len(here.drive) == 40
    place = dict(zip(here.map.ids.tolist(), here.map.xy, strict=True))
    for step, pose in zip(here.drive, _true_path(landmarks, 40, 3), strict=True):
        away = {i: float(np.hypot(*(xy - pose[:2]))) for i, xy in place.items()}
        nearest = sorted((i for i in away if away[i] > NEAREST), key=away.__getitem__)[:6]
        assert sorted(step.sightings.ids.tolist()) == sorted(nearest)


def test_scattered_sightings_are_anywhere_on_the_map() -> None:
    near, anywhere = (world(300, 60, 6, 0, scattered=scattered) for scattered in (False, True))
    ranges = [np.concatenate([step.sightings.z[:, 0] for step in w.drive]) for w in (near, anywhere)]
    assert np.median(ranges[0]) < 4
    assert np.median(ranges[1]) > 8
    assert all(len(set(step.sightings.ids.tolist())) == 6 for step in anywhere.drive)


def test_errors_are_as_large_as_their_covariances_say() -> None:
    """6,000 sightings and 1,000 motions: squared errors over variances, whose means scatter by sqrt(2/n)."""
    here = world(100, 1000, 6, 5)
    path = [here.start, *_true_path(100, 1000, 5)]
    place = dict(zip(here.map.ids.tolist(), here.map.xy, strict=True))
    motion, sighting = list[Array](), list[Array]()
    for before, pose, step in zip(path, path[1:], here.drive, strict=False):
        assert step.odometry.cov == pytest.approx(np.diag(np.square(ODOMETRY_SD)))
        motion.append((step.odometry.delta - between(before, pose)) / ODOMETRY_SD)
        for i, z in zip(step.sightings.ids.tolist(), step.sightings.z, strict=True):
            dx, dy = place[i] - pose[:2]
            error = z - np.array([np.hypot(dx, dy), np.arctan2(dy, dx) - pose[2]])
            sighting.append(np.array([error[0], wrap(error[1])]) / SIGHTING_SD)
    for errors in (np.array(motion), np.array(sighting)):
        assert np.abs((errors**2).mean(axis=0) - 1).max() < 5 * np.sqrt(2 / len(errors))


def test_steps_are_timed_until_the_budget_is_spent() -> None:
    class Busy:
        steps = 0

        def step(self, step: object) -> Array:
            Busy.steps += 1
            sum(range(20_000))
            return np.zeros(3)

    drive = world(10, 400, 6, 0).drive
    assert len(stepped(Busy(), drive, 1e-9)) == LEAST == Busy.steps
    assert len(stepped(Busy(), drive, 60.0)) == 400
    assert (stepped(Busy(), drive[:5], 60.0) > 0).all()


def test_bytes_are_those_of_arrays_that_the_backend_made() -> None:
    @dataclass
    class Inner:
        rows: list[Any]

    class Holder:
        def __init__(self, log: Array) -> None:
            whole = np.zeros((10, 10))
            self.view, self.again = whole[2:], whole.T
            self.inner = {"a": Inner([np.zeros(7), np.zeros(5, np.float32)])}
            self.log = log[1:]

    log = np.zeros(1000)
    log.flags.writeable = False
    assert array_bytes(Holder(log)) == 800 + 56 + 20
    assert not holds_foreign(Holder(log))


def test_gtsams_objects_are_foreign() -> None:
    import gtsam

    class Holder:
        inner = None

    holder = Holder()
    holder.inner = gtsam.NonlinearFactorGraph()  # pyright: ignore[reportAttributeAccessIssue]
    assert holds_foreign(holder)


def test_a_stopwatch_adds_up_the_calls_of_what_it_watches() -> None:
    class Worker:
        def work(self, k: int) -> int:
            return sum(range(k))

        def fail(self) -> None:
            raise ValueError("tired")

        def rest(self) -> None: ...

    watch, worker = Stopwatch(), Worker()
    watch.watch(worker, "work")
    watch.watch(worker, "fail")
    assert worker.work(5) == 10
    worker.rest()
    first = watch.spent["work"]
    assert worker.work(200_000) == 19_999_900_000
    assert watch.spent["work"] > first
    with pytest.raises(ValueError, match="tired"):
        worker.fail()
    assert set(watch.spent) == {"work", "fail"}
    assert watch.calls == 3


def test_isam2_is_taken_apart() -> None:
    rows = measure(Process((Subject("isam2", "isam2", _options("isam2")),), (10,), None, LITTLE))
    whole, *parts = rows
    assert whole.timing.steps == 12
    assert whole.resident_bytes is not None
    assert whole.finish_ms is not None
    assert [row.name for row in parts] == [*PARTS, "marginal", "back-substitution", WHOLE, BY_HAND]
    assert all(row.kind == "part" and row.beside == "isam2" and row.timing for row in parts)
    total = step_of_parts(rows, "isam2", 10)
    assert total == pytest.approx(sum(row.timing.mean for row in parts[:3] if row.timing))


def test_a_filter_comes_with_its_references() -> None:
    subjects = tuple(Subject(f"ekf{k}", "ekf", EkfOptions(compress_above=k)) for k in (0, 1000))
    rows = measure(Process(subjects, (10,), None, LITTLE))
    assert [row.name for row in rows if row.kind == "backend"] == ["ekf0", "ekf1000"]
    assert [row.name for row in rows if row.kind == "reference"] == ["dsyrk", "memory", "textbook", "locate"]
    assert all(row.timing and row.landmarks == 10 for row in rows)
    assert all(row.array_bytes and row.array_bytes >= 8 * 23 * 23 and row.resident_bytes is None for row in rows[:2])
    assert {row.beside for row in rows[2:]} == {"ekf"}


def test_particles_are_those_asked_for_at_every_size() -> None:
    rows = measure(Process((Subject("fastslam", "fastslam", FastSlamOptions()),), (3, 10), 40, LITTLE))
    found = [(row.name, row.landmarks, row.particles) for row in rows]
    assert found == [(name, n, 40) for n in (3, 10) for name in ("fastslam", "particle loop")]
    assert all(row.timing for row in rows)


def test_what_a_backend_raises_is_its_rows_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(SUPPORT)
    subjects = (Subject("bad", "misbehaving:raises", NoOptions()), Subject("good", "dead-reckoning", NoOptions()))
    bad, good = measure(Process(subjects, (10,), None, LITTLE))
    assert bad.timing is None
    assert "ValueError" in bad.reason
    assert "misbehaving.py:" in bad.reason
    assert good.timing is not None


def test_a_survey_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "PATIENCE", 0.0)
    (row,) = measure(Process((Subject("dead-reckoning", "dead-reckoning", NoOptions()),), (30,), None, LITTLE))
    assert "map was not made within 0 s of CPU: 1 of" in row.reason


def test_ratios_are_of_medians_and_of_means_and_say_what_was_expected() -> None:
    dense, compressed = EkfOptions(compress_above=10**6), EkfOptions(compress_above=200)
    rows = [
        TimingRow("backend", "ekf", 100, timing=flat(30)),
        TimingRow("backend", "ekf", 300, timing=flat(10)),
        TimingRow("backend", "ekf", 1000, timing=flat(12)._replace(mean=100.0)),
        TimingRow("backend", "ekf[dense]", 100, timing=flat(29)),
        TimingRow("backend", "ekf[dense]", 300, timing=flat(200)),
        TimingRow("backend", "ekf[dense]", 1000, timing=flat(2000)._replace(mean=2400.0)),
        TimingRow("reference", "textbook", 100, timing=flat(4500), beside="ekf"),
        TimingRow("reference", "dsyrk", 300, timing=flat(125), beside="ekf"),
        TimingRow("reference", "locate", 300, timing=flat(60_000), beside="ekf"),
        TimingRow("backend", "fastslam[version=1]", 100, 100, flat(40)),
        TimingRow("backend", "fastslam[version=1]", 100, 10_000, flat(2000)),
        TimingRow("backend", "fastslam[version=1]", 1000, 10_000, flat(2600)),
        TimingRow("backend", "fastslam", 100, 100, flat(100)),
        TimingRow("reference", "particle loop", 100, 100, flat(40_000)),
        TimingRow("backend", "isam2", 100, timing=flat(1000)),
        *(
            TimingRow("part", name, 100, timing=flat(us), beside="isam2")
            for name, us in zip((*PARTS, WHOLE, BY_HAND), (500, 450, 50, 1000, 900), strict=True)
        ),
    ]
    versions = {"fastslam[version=1]": _Version(1), "fastslam": _Version(2)}
    found = ratios(rows, {"ekf": compressed, "ekf[dense]": dense, **versions})
    reached = {r.what: (r.expected, r.found, r.holds) for r in found}
    assert reached == {
        "textbook filter / dense ekf, N=100, median step": ("at least 80 times", "150 times", True),
        "dense ekf / bare dsyrk, N=300, median step": ("within 1.5 times", "1.60 times", False),
        "dense ekf / compressed ekf, N=1,000, mean step": ("at least 15 times", "24.0 times", True),
        "compressed ekf, N=1,000 / N=300, median step": ("within 1.5 times", "1.20 times", True),
        "particle loop / fastslam 1.0, M=100 N=100, median step": ("at least 300 times", "1,000 times", True),
        "fastslam 1.0, N=1,000 / N=100, M=10,000, median step": ("within 1.2 times", "1.30 times", False),
        "fastslam 2.0 / 1.0, M=100, median step, worst N": ("within 4 times", "2.50 times", True),
        "Python's own share of isam2's step, N=100": ("under 15 %", "5.00 %", True),
        "isam2 / GTSAM by hand, N=100, median step": ("within 1.15 times", "1.11 times", True),
        "a search for the robot on the whole map, N=300, p99": ("within 100 ms", "60.0 ms", True),
    }


def test_csv_has_every_column_and_blanks() -> None:
    rows = [
        TimingRow("backend", "ekf", 10, timing=timing(np.array([1000, 2000, 6000])), array_bytes=99),
        TimingRow("backend", "ukf", 10, reason="it diverged, twice"),
    ]
    first, second = csv.DictReader(as_csv(rows).splitlines())
    assert tuple(first) == COLUMNS
    assert (first["mean_us"], first["p50_us"], first["max_us"], first["array_bytes"]) == ("3.0", "2.0", "6.0", "99")
    assert (first["fifth3_us"], first["fifth4_us"], first["particles"], first["reason"]) == ("6.0", "", "", "")
    assert (second["reason"], second["steps"], second["mean_us"]) == ("it diverged, twice", "", "")


def test_names_keep_their_order_and_their_distance() -> None:
    heights = apart([10.0, 11.0, 50.0, 9.0], 5.0)
    assert heights == pytest.approx([10.0, 15.0, 50.0, 5.0])
    close = apart([0.0, 4.0, 8.0, 12.0], 5.0)
    assert np.diff(close) == pytest.approx(5.0)
    assert np.mean(close) == pytest.approx(6.0)


def test_nothing_timed_is_nothing_drawn(tmp_path: Path) -> None:
    assert not write_figure(tmp_path / "a.png", [TimingRow("backend", "ekf", 10, reason="broken")], "nothing")
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, table = tmp_path / "out", tmp_path / "t.csv"
    sizes = ["--sizes", "10,4", "--particles", "20", "--steps", "8", "--csv", str(table), "--out", str(out)]
    names = "dead-reckoning,fastslam,nowhere:build"
    assert main(["speed", "--quick", "--backend", names, *sizes]) == 0
    said = capsys.readouterr().out
    for words in ("timed fastslam: N=4, 10, M=20", "6 sightings a step, of the nearest landmarks", "wrote: "):
        assert words in said
    assert all(words in said for words in ("particle loop", "nowhere", "No module"))
    assert sorted(path.name for path in out.iterdir()) == ["backends.csv", "backends.png", "ratios.csv"]
    assert (out / "backends.png").read_bytes().startswith(b"\x89PNG")
    assert table.read_text() == (out / "backends.csv").read_text()
    rows = csv_rows(table)
    backends = [(r["name"], r["landmarks"], r["particles"]) for r in rows if r["kind"] == "backend"]
    assert backends[:2] == [("dead-reckoning", "4", ""), ("dead-reckoning", "10", "")]
    assert backends[2:4] == [("fastslam", "4", "20"), ("fastslam", "10", "20")]
    assert [r["steps"] for r in rows if r["name"] == "dead-reckoning"] == ["8", "8"]


@dataclass(frozen=True)
class _Version:
    version: int = 1


def _options(name: str) -> Any:
    from slamduel.backends import registry

    return registry.find(name).options()


def _true_path(landmarks: int, steps: int, seed: int) -> list[Array]:
    """The drive's true poses, recovered from a world whose motion has no error to speak of."""
    from slamduel.bench.speed import world as speed_world

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(speed_world, "ODOMETRY_SD", (1e-12, 1e-12, 1e-12))
        exact = world(landmarks, steps, 6, seed)
    path, pose = list[Array](), exact.start
    for step in exact.drive:
        pose = compose(pose, step.odometry.delta)
        path.append(pose)
    return path


def test_a_surveyed_belief_has_the_whole_map() -> None:
    here = world(10, 2, 6, 0)
    known = here.surveyed().map
    assert isinstance(known, Map)
    assert known.cov is not None
    assert known.cov.shape == (20, 20)
    assert np.linalg.eigvalsh(known.cov).min() > 0
