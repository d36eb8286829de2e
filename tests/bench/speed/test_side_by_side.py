"""Backends in turns on the same steps, and MRPT's EKF beside them. Nothing here asserts a time."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from places import SUPPORT
from slamduel.backends import registry
from slamduel.bench.plan.spec import backend_variants
from slamduel.bench.speed import mrpt
from slamduel.bench.speed.mrpt import NAME, NOT_INSTALLED, Program, built, mrpt_row
from slamduel.bench.speed.process import Process, Stretch, Subject
from slamduel.bench.speed.side_by_side import TOGETHER, Together, chosen, measure_together
from slamduel.bench.speed.tables import as_csv, backend_table, together_table
from slamduel.bench.speed.timing import Timing, TimingRow, in_turns
from slamduel.bench.speed.world import world
from slamduel.bench.words.console import screen_console
from slamduel.core.factors import Step
from slamduel.core.se2 import Array, compose

LITTLE = Stretch(steps=12, sightings=6, seconds=0.5, seed=0, scattered=False)
ABSENT = Program(None, "", NOT_INSTALLED)

STAND_IN = """\
#!{python}
import sys
survey, drive, *sds = sys.stdin.readline().split()
assert sds == ["0.1", "0.03"], sds
for line in sys.stdin:
    motion, k = line.split()[:9], int(line.split()[9])
    assert len(line.split()) == 10 + 3 * k
    assert all(float(word) == float(word) for word in motion)
    drive = int(drive) - (int(survey) <= 0)
    survey = int(survey) - 1
assert (int(survey), int(drive)) == (-{drive}, 0), (survey, drive)
{ending}
"""


def subject(name: str) -> Subject:
    return Subject(name, name, registry.find(name).options())


def flat(us: float) -> Timing:
    return Timing(100, us, us, us, us, us, (us,) * 5)


def printed(table: object) -> str:
    console = screen_console(quiet=False)
    with console.capture() as captured:
        console.print(table)
    return " ".join(captured.get().split())


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


def test_those_with_default_options_are_compared_where_there_are_two() -> None:
    found = chosen(backend_variants("isam2,ukf,ekf,ekf[gate=0.9],nowhere:build"))
    assert [one.label for one in found] == ["ekf", "isam2"]
    assert chosen(backend_variants("ekf[gate=0.9],isam2,graph")) == ()
    assert set(TOGETHER) <= set(registry.BUILTIN)


def test_each_has_a_row_and_one_that_fails_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(SUPPORT)
    lame = Subject("lame", "misbehaving:raises", registry.find("misbehaving:raises").options())
    process = Process((subject("ekf"), lame, subject("isam2")), (4, 10), None, LITTLE)
    rows = measure_together(Together(process, ABSENT))
    names = ("lame", "ekf", "isam2", NAME)
    assert [(row.landmarks, row.name) for row in rows] == [(size, name) for size in (4, 10) for name in names]
    assert {row.kind for row in rows} == {"together"}
    timed = [row for row in rows if row.timing is not None]
    assert [(row.name, row.implementation) for row in timed[:2]] == [
        ("ekf", "compiled here"),
        ("isam2", "GTSAM's wheel"),
    ]
    assert all(row.timing and row.timing.steps == 12 for row in timed)
    assert "ValueError" in rows[0].reason
    assert rows[3].reason == NOT_INSTALLED


def test_ratios_are_to_the_reference_at_the_same_size() -> None:
    rows = [
        TimingRow("together", "ekf", 10, timing=flat(4.0), implementation="compiled here"),
        TimingRow("together", "isam2", 10, timing=flat(50.0)._replace(p99=400.0), implementation="GTSAM's wheel"),
        TimingRow("together", NAME, 10, reason=NOT_INSTALLED),
        TimingRow("together", "ekf", 100, reason="lost"),
        TimingRow("together", "isam2", 100, timing=flat(60.0), implementation="GTSAM's wheel"),
    ]
    said = printed(together_table(rows, "ekf")).replace("\N{MULTIPLICATION SIGN}", "x")
    assert "ekf compiled here 100 4.00 1.00 x 4.00 1.00 x 4.00 1.00 x" in said
    assert "isam2 GTSAM's wheel 100 50.0 12.5 x 50.0 12.5 x 400 100 x" in said
    assert "isam2 GTSAM's wheel 100 60.0 60.0 60.0" in said
    assert f"{NAME}, N=10: {NOT_INSTALLED.partition(';')[0]}" in said
    assert "Costs compare implementations, not algorithms alone." in said


def test_tables_and_csv_say_whose_programs_they_are() -> None:
    rows = [
        TimingRow("backend", "ekf", 10, timing=flat(4.0), implementation="compiled here"),
        TimingRow("backend", "isam2", 10, timing=flat(50.0), implementation="GTSAM's wheel"),
    ]
    assert "compiled here: ekf; GTSAM's wheel: isam2. Costs compare" in printed(backend_table(rows, "title"))
    assert "Costs compare" not in printed(backend_table(rows[:1], "title"))
    whose = [row["implementation"] for row in csv.DictReader(as_csv(rows).splitlines())]
    assert whose == ["compiled here", "GTSAM's wheel"]


@pytest.mark.parametrize(
    ("ending", "reason"),
    [
        ("print('1000\\n2000\\n4000\\npose 0 0 0')", ""),
        ("sys.exit(3)", "its map was not made within 60 s of CPU"),
        ("sys.exit('no such library')", "it ended with status 1: no such library"),
    ],
)
def test_what_mrpts_program_says_is_read(tmp_path: Path, ending: str, reason: str) -> None:
    here = world(4, 5, 6, 0)
    place = tmp_path / "program"
    place.write_text(STAND_IN.format(python=sys.executable, drive=len(here.drive), ending=ending))
    place.chmod(0o700)
    row = mrpt_row(Program(place, "2.5", ""), here, 1.0, 60.0)
    assert row.reason == reason
    if not reason:
        assert (row.timing.steps, row.timing.p50, row.implementation) == (3, 2.0, "MRPT 2.5")


def test_without_cmake_or_mrpt_it_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    false = tmp_path / "cmake"
    false.write_text("#!/bin/sh\nexit 1\n")
    false.chmod(0o700)
    for folder in (tmp_path, tmp_path / "empty"):
        monkeypatch.setenv("PATH", str(folder))
        assert built(tmp_path) == ABSENT


@pytest.mark.slow
def test_mrpts_filter_goes_the_same_way_where_it_is_installed(tmp_path: Path) -> None:
    """Its path differs from the EKF's by how each linearises, less than the odometry alone is off."""
    program = built(tmp_path)
    if program.path is None:
        pytest.skip(f"MRPT is {program.reason}")
    here = world(30, 200, 6, 0)
    assert mrpt_row(program, here, 60.0, 60.0).timing is not None
    text = "\n".join([f"{len(here.survey)} {len(here.drive)} 0.1 0.03", *mrpt._lines(here)])  # pyright: ignore
    done = subprocess.run([program.path, "60", "60"], input=text, capture_output=True, text=True, check=True)
    last = np.array([float(word) for word in done.stdout.splitlines()[-1].split()[1:]])
    ekf = registry.find("ekf")
    backend = ekf.make(here.prior, ekf.options(), np.random.default_rng(0))
    path = [backend.step(step) for step in (*here.survey, *here.drive)]
    off = compose(here.prior.pose, last) - np.array(path[-1], float)
    assert np.abs(off[:2]).max() < 0.2


def test_the_source_is_there() -> None:
    assert os.path.getsize(mrpt.SOURCE) > 1000
