"""`bench speed`: what it measures, how figures are made of that, and what it writes. Nothing here asserts a time."""

import csv
from pathlib import Path

import numpy as np
import pytest

from csv_rows import csv_rows
from places import SUPPORT
from slamduel.backends import registry
from slamduel.backends.api import NoOptions
from slamduel.bench.cli import main
from slamduel.bench.speed import process
from slamduel.bench.speed.backends import measure
from slamduel.bench.speed.isam2_parts import BY_HAND, PARTS, WHOLE, Stopwatch
from slamduel.bench.speed.process import Process, Stretch, Subject
from slamduel.bench.speed.tables import COLUMNS, as_csv, step_of_parts, turns_table
from slamduel.bench.speed.timing import LEAST, Timing, TimingRow, in_turns, timing
from slamduel.bench.speed.world import NEAREST, ODOMETRY_SD, SIGHTING_SD, world
from slamduel.bench.words.console import screen_console
from slamduel.core.factors import Step
from slamduel.core.se2 import Array, Ints, between, compose, wrap

LITTLE = Stretch((10,), steps=12, sightings=6, seconds=0.5)


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

    def spent(seconds: float) -> Ints:
        (ns,) = in_turns([Busy()], [drive], seconds)
        return ns

    assert len(spent(1e-9)) == LEAST == Busy.steps
    assert len(spent(60.0)) == 400
    assert (spent(60.0) > 0).all()


def test_all_take_the_same_steps_and_in_turns() -> None:
    taken: list[tuple[str, float]] = []

    class Stepper:
        def __init__(self, name: str) -> None:
            self.name = name

        def step(self, step: Step) -> Array:
            taken.append((self.name, step.t))
            return np.zeros(3)

    drive = world(10, 400, 6, 0).drive
    a, b = in_turns([Stepper("a"), Stepper("b")], [drive, drive], 60.0)
    assert len(a) == len(b) == 400
    times = [step.t for step in drive]
    assert [t for name, t in taken if name == "a"] == [t for name, t in taken if name == "b"] == times
    turns = [name for k, (name, _) in enumerate(taken) if k == 0 or taken[k - 1][0] != name]
    assert turns == ["a", "b"] * (len(turns) // 2)
    assert len(turns) > 8


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


def test_a_survey_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "PATIENCE", 0.0)
    (row,) = measure(Process((Subject("dead-reckoning", "dead-reckoning", NoOptions()),), 30, LITTLE))
    assert "map was not made within 0 s of CPU: 1 of" in row.reason


def test_isam2_is_taken_apart_and_what_fails_is_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(SUPPORT)
    bad = Subject("bad", "misbehaving:raises", NoOptions())
    rows = measure(Process((_subject("ekf"), bad, _subject("isam2")), 10, LITTLE))
    assert [row.name for row in rows] == [
        "bad",
        "ekf",
        "isam2",
        *PARTS,
        "marginal",
        "back-substitution",
        WHOLE,
        BY_HAND,
    ]
    assert [row.implementation for row in rows[1:3]] == ["compiled here", "GTSAM's wheel"]
    assert "ValueError" in rows[0].reason
    assert "misbehaving.py:" in rows[0].reason
    parts = rows[3:]
    assert all(row.timing and row.timing.steps == 12 for row in rows[1:3])
    assert all(row.kind == "part" and row.beside == "isam2" and row.timing for row in parts)
    assert step_of_parts(rows, "isam2", 10) == pytest.approx(sum(row.timing.mean for row in parts[:3] if row.timing))


def test_ratios_are_to_the_first_at_the_same_size() -> None:
    rows = [
        TimingRow("backend", "ekf", 10, timing=flat(4.0), implementation="compiled here"),
        TimingRow("backend", "isam2", 10, timing=flat(50.0)._replace(p99=400.0), implementation="GTSAM's wheel"),
        TimingRow("backend", "mrpt-ekf", 10, reason="not installed"),
        TimingRow("backend", "mrpt-ekf", 100, reason="not installed"),
        TimingRow("backend", "ekf", 100, reason="lost"),
        TimingRow("backend", "isam2", 100, timing=flat(60.0), implementation="GTSAM's wheel"),
        TimingRow("backend", "mine", 0, reason="No module"),
    ]
    console = screen_console(quiet=False)
    with console.capture() as captured:
        console.print(turns_table(rows, "6 sightings"))
    said = " ".join(captured.get().split()).replace("\N{MULTIPLICATION SIGN}", "x")
    assert "how many times ekf or isam2's: 6 sightings" in said
    assert "ekf compiled here 100 4.00 1.00 x 4.00 1.00 x 4.00 1.00 x" in said
    assert "isam2 GTSAM's wheel 100 50.0 12.5 x 50.0 12.5 x 400 100 x" in said
    assert "isam2 GTSAM's wheel 100 60.0 1.00 x" in said
    assert "mrpt-ekf, N=10 and N=100: not installed." in said
    assert "mine: No module." in said
    assert "Costs compare implementations, not algorithms alone." in said


def test_csv_has_every_column_and_blanks() -> None:
    rows = [
        TimingRow("backend", "ekf", 10, timing=timing(np.array([1000, 2000, 6000])), implementation="compiled here"),
        TimingRow("backend", "ukf", 10, reason="it diverged, twice"),
    ]
    first, second = csv.DictReader(as_csv(rows).splitlines())
    assert tuple(first) == COLUMNS
    assert (first["mean_us"], first["p50_us"], first["max_us"], first["fifth3_us"]) == ("3.0", "2.0", "6.0", "6.0")
    assert (first["fifth4_us"], first["reason"], first["implementation"]) == ("", "", "compiled here")
    assert (second["reason"], second["steps"], second["mean_us"]) == ("it diverged, twice", "", "")


def test_the_command_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, table = tmp_path / "out", tmp_path / "t.csv"
    sizes = ["--sizes", "10,4", "--steps", "8", "--csv", str(table), "--out", str(out)]
    assert main(["speed", "--quick", "--backend", "dead-reckoning,ekf,nowhere:build", *sizes]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for words in ("timed dead-reckoning, ekf: N=4", "6 sightings a step, of the nearest landmarks", "wrote: "):
        assert words in said
    assert all(words in said for words in ("nowhere", "No module"))
    assert [path.name for path in out.iterdir()] == ["backends.csv"]
    assert table.read_text() == (out / "backends.csv").read_text()
    rows = csv_rows(table)
    assert [(r["name"], r["landmarks"], r["steps"]) for r in rows] == [
        ("dead-reckoning", "4", "8"),
        ("ekf", "4", "8"),
        ("dead-reckoning", "10", "8"),
        ("ekf", "10", "8"),
        ("nowhere:build", "0", ""),
    ]


def _subject(name: str) -> Subject:
    return Subject(name, name, registry.find(name).options())


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
