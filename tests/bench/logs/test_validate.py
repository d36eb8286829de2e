"""bench validate: all problems of a folder, the first of another dataset, and remarks on what is odd."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import refused
from slamduel.bench.cli import main
from slamduel.bench.commands.validate import SHOWN
from slamduel.bench.contradiction.remark import STAGES
from slamduel.bench.words.console import COMPILING
from slamduel.core.factors import UNKNOWN, Dataset, Log, Prior
from slamduel.core.partial import NO_IDS
from slamduel.datasets.formats import log_folder
from slamduel.datasets.remarks import remarks
from small_log import small_dataset

Change = Callable[[dict[str, Any]], Any]
Validated = Callable[..., list[str]]


@pytest.fixture
def validated(capsys: pytest.CaptureFixture[str]) -> Validated:
    """`validated(2, "a", "b")`: the lines that are printed of these logs, with that exit status."""

    def lines(status: int, *words: str | Path) -> list[str]:
        assert main(["validate", *map(str, words)]) == status
        printed = capsys.readouterr()
        # said of what takes long, as on a machine at work
        slow = ("reading ", *STAGES, "counting ", "trying ", COMPILING)
        assert all(line.startswith(slow) for line in printed.err.splitlines())
        return printed.out.splitlines()

    return lines


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    log_folder.write(tmp_path / "log", *small_dataset())
    return tmp_path / "log"


def test_a_log_is_counted(folder: Path, validated: Validated):
    *_, line = validated(0, folder)
    digest = small_dataset().log.digest[:12]
    counts = "6 steps, 6 sightings of 3 landmarks, truth of 5 steps and of 3 landmarks"
    assert line == f"{folder}: can be read, with 2 remarks; {counts}; digest {digest}."


def test_a_log_of_one_step_is_counted_in_the_singular(tmp_path: Path, validated: Validated):
    log, truth = small_dataset()
    one = truth._replace(t=truth.t[:1], poses=truth.poses[:1], map=None, assigned=None)
    log_folder.write(tmp_path / "log", log.head(1), one)
    *_, line = validated(0, tmp_path / "log")
    assert "can be read, with 1 remark; 1 step, 3 sightings of 1 landmark, truth of 1 step; digest " in line


def test_every_problem_is_a_line(folder: Path, validated: Validated):
    for name, old, new in (("odometry.csv", "t,dx", "t,x"), ("landmarks.csv", "\n3,", "\nthree,")):
        text = (folder / name).read_text(encoding="utf-8")
        (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    first, second, total = validated(2, folder)
    assert first.startswith(
        f"{folder / 'odometry.csv'}, line 1: column 'x' in place of 'dx', expected the columns t,dx,"
    )
    assert second == f"{folder / 'landmarks.csv'}, line 2: id is 'three', expected a number."
    assert total == f"{folder}: 2 problems."


@pytest.mark.parametrize(("flags", "shown"), [([], SHOWN), (["--all"], 50)])
def test_many_problems_are_counted_and_shown_when_asked_for(
    folder: Path, validated: Validated, flags: list[str], shown: int
):
    (folder / "landmarks.csv").write_text("id,x,y\n" + "1,2,far\n" * 50, encoding="utf-8")
    *lines, total = validated(2, *flags, folder)
    assert len(lines) == shown
    assert total.startswith(f"{folder}: 50 problems")
    assert ("--all shows" in total) == (not flags)


def test_several_logs_and_one_bad(folder: Path, tmp_path: Path, validated: Validated):
    log_folder.write(tmp_path / "bad", small_dataset().log, None)
    (tmp_path / "bad" / "sightings.csv").unlink()
    bad, total, *others = validated(2, tmp_path / "bad", folder, "city[landmarks=40,steps=50]")
    assert bad == f"{tmp_path / 'bad' / 'sightings.csv'}: there is no such file."
    assert total == f"{tmp_path / 'bad'}: 1 problem."
    good = [line for line in others if not line.startswith("remark: ")]
    assert good[0].startswith(f"{folder}: can be read, with 2 remarks; 6 steps")
    assert good[1].startswith("city[landmarks=40,steps=50]: good; 50 steps")


def test_what_another_reader_says_is_the_problem(tmp_path: Path, validated: Validated):
    lines = validated(2, f"log[path={tmp_path / 'nowhere'}]", "log")
    assert lines[0] == f"{tmp_path / 'nowhere'}: there is no such folder, expected that of a log."
    assert lines[2].startswith("option path of dataset log is not given")


def test_every_name_is_looked_up(folder: Path, tmp_path: Path, validated: Validated):
    lines = validated(2, "missing", folder, tmp_path / "nowhere", "city[landmarks=0]", folder)
    first, good, nowhere, total, option, again = (line for line in lines if not line.startswith("remark: "))
    assert "there is no dataset 'missing'" in first
    assert good == again
    assert good.startswith(f"{folder}: can be read, ")
    assert nowhere == f"{tmp_path / 'nowhere'}: there is no such folder, expected that of a log."
    assert total == f"{tmp_path / 'nowhere'}: 1 problem."
    assert "option landmarks=0 is out of range" in option


def drive(change: Change | None = None) -> Dataset:
    """Thirty even steps with the same four landmarks sighted at each, in all directions."""
    n, rng = 30, np.random.default_rng(3)
    step = np.repeat(np.arange(n), 4)
    parts: dict[str, Any] = {
        "name": "drive",
        "prior": Prior(np.zeros(3), np.eye(3)),
        "t": 0.5 * np.arange(n),
        "delta": np.array([1.0, 0.0, 0.1]) + 0.01 * rng.standard_normal((n, 3)),
        "delta_cov": np.tile(np.eye(3), (n, 1, 1)),
        "sighting_step": step,
        "ids": np.arange(len(step)) % 4,
        "z": np.stack((rng.uniform(1, 5, len(step)), rng.uniform(-3, 3, len(step))), axis=-1),
        "z_cov": np.tile(np.eye(2), (len(step), 1, 1)),
    }
    if change is not None:
        change(parts)
    return Dataset(Log.from_arrays(**parts), None)


def put(name: str, place: Any, value: Any) -> Change:
    return lambda parts: parts[name].__setitem__(place, value)


def times(name: str, factor: Any) -> Change:
    return lambda parts: parts.update({name: parts[name] * factor})


def later(parts: dict[str, Any]) -> None:
    parts["t"][20:] += 30.0


ODD: dict[str, tuple[Change, str]] = {
    "a gap": (
        later,
        "1 gap in time of more than 10 times the median of 0.5 s, the longest of 30.5 s before step 20 (40 s)",
    ),
    "milliseconds": (
        times("t", 1000.0),
        "the median time between steps is 500 s: perhaps the times are in milliseconds",
    ),
    "a jump": (
        put("delta", (7, 0), 9.0),
        "1 jump of the odometry's dx: more than 20 standard deviations of the other steps",
    ),
    "a jerk": (put("delta", (7, 2), -2.0), "the first of -2 rad at step 7 (3.5 s)"),
    "turns in degrees": (times("delta", np.array([1.0, 1.0, 30.0])), "rad/s: perhaps it was in degrees a second"),
    "strides in millimetres": (
        times("delta", np.array([2000.0, 2000.0, 1.0])),
        "perhaps the motions are in millimetres",
    ),
    "ranges in millimetres": (times("z", np.array([1000.0, 1.0])), "perhaps the ranges are in millimetres"),
    "bearings divided by 57": (times("z", np.array([1.0, np.pi / 180])), "perhaps it is in other units than radians"),
    "steps of another count": (
        lambda parts: parts.update(sighting_step=parts["sighting_step"] // 3, ids=np.arange(120) % 12),
        "at step 9 (4.5 s), the log has 30 steps: perhaps the sensor stopped, or in a log's folder the column step",
    ),
    "no id": (put("ids", slice(0, 20), UNKNOWN), "20 of 120 sightings have no id"),
    "never met again": (lambda parts: parts.update(ids=np.arange(120)), "120 of 120 landmarks are sighted only once"),
    "blind": (
        lambda parts: parts.update(
            sighting_step=np.zeros(0, int), ids=np.zeros(0, int), z=np.zeros((0, 2)), z_cov=np.zeros((0, 2, 2))
        ),
        "there is no sighting",
    ),
}


@pytest.mark.parametrize("steps", [2, 30])
def test_an_ordinary_drive_needs_no_remark(steps: int):
    assert list(remarks(Dataset(drive().log.head(steps), None))) == []


@pytest.mark.parametrize(("change", "words"), ODD.values(), ids=ODD.keys())
def test_what_is_odd_is_remarked(change: Change, words: str):
    (remark,) = remarks(drive(change))
    assert words in remark
    assert not remark.endswith((".", "?"))  # the command ends it


@pytest.mark.parametrize("huge", [1e10, 1e200, 1.7e308])
def test_what_is_huge_is_remarked_whatever_its_square(huge: float):
    """Warnings would be errors here."""
    size, jump = remarks(drive(put("delta", (7, 0), -huge)))
    assert size == f"1 motion of more than 1e+09 m, the largest of {huge:.3g} m, the first at step 7 (3.5 s)"
    assert jump.startswith("1 jump of the odometry's dx")
    assert f"the first of {-huge:.3g} m at step 7 (3.5 s)" in jump
    found = remarks(drive(times("delta", np.array([huge, huge, 1.0]))))
    assert any("perhaps the motions are in millimetres" in remark for remark in found)
    found = remarks(drive(times("z", np.array([huge / 10, 1.0]))))
    assert any("perhaps the ranges are in millimetres" in remark for remark in found)
    assert found[0].startswith("120 ranges of more than 1e+09 m")


def test_remarks_on_a_folder_name_the_file_the_line_and_the_time(tmp_path: Path):
    far = drive(put("delta", (7, 0), 9.0))
    z = far.log.z.copy()
    z[13, 0] = 2e9
    log_folder.write(tmp_path / "log", replace(far.log, z=z), None)
    ranges, jump, *_ = remarks(log_folder.read(tmp_path / "log"))
    step = far.log.sighting_step[13]
    assert ranges.endswith(f"the first at {tmp_path / 'log' / 'sightings.csv'}, line 15 ({far.log.t[step]:g} s)")
    assert jump.endswith(f"the first of 9 m at {tmp_path / 'log' / 'odometry.csv'}, line 9 (3.5 s)")


def test_steps_whose_times_only_count_them_are_named_by_their_number():
    log, _ = drive(put("delta", (7, 0), 9.0))
    (remark,) = remarks(Dataset(replace(log, t=np.arange(float(len(log)))), None))
    assert remark.endswith("the first of 9 m at step 7")


def test_a_robot_that_bends_at_some_steps_does_not_jump():
    """Or that stands still most of the time; only what is unlike all others is a jump."""
    assert list(remarks(drive(put("delta", (slice(None, None, 6), 2), 1.5)))) == []
    assert list(remarks(drive(put("delta", (slice(3, None), slice(None)), 0.0)))) == []


def test_remarks_are_printed_and_do_not_count(tmp_path: Path, validated: Validated):
    log_folder.write(tmp_path / "log", drive(later).log, None)
    remark, good = validated(0, tmp_path / "log")
    assert remark.startswith(f"remark: {tmp_path / 'log'}: 1 gap in time")
    assert ": can be read, with 1 remark; 30 steps, 120 sightings of 4 landmarks, no truth; " in good


def test_a_remark_is_a_problem_where_that_is_asked_for(
    tmp_path: Path, validated: Validated, capsys: pytest.CaptureFixture[str]
):
    log_folder.write(tmp_path / "log", drive(later).log, None)
    _, said = validated(2, "--strict", tmp_path / "log")
    assert said == f"{tmp_path / 'log'}: 1 remark, which --strict refuses."
    assert main(["show", "--json", str(tmp_path / "log")]) == 0
    assert json.loads(capsys.readouterr().out)["remarks"][0].startswith("1 gap in time")
    assert "--strict: " in refused(capsys, "show", "--strict", "--out", tmp_path / "x.png", tmp_path / "log")
    assert not (tmp_path / "x.png").exists()


def test_a_log_is_shown_with_its_remarks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    log_folder.write(tmp_path / "log", drive(later).log, None)
    assert main(["show", "./log", "--out", "x.html"]) == 0
    assert " ".join(capsys.readouterr().out.split()).count("remark 1 gap in time") == 1
    assert "<b>remark</b> 1 gap in time" in (tmp_path / "x.html").read_text()


def test_a_log_whose_ranges_have_no_id_is_not_good(tmp_path: Path, validated: Validated):
    """Every backend is skipped on it, for the reason of the remark; --strict refuses it."""
    (tmp_path / "odometry.csv").write_text("t,x,y,heading\n" + "".join(f"{k},{k / 2},0,0\n" for k in range(30)))
    (tmp_path / "ranges.csv").write_text("t,id,range\n" + "".join(f"{k},-1,{3 + k / 9}\n" for k in range(30)))
    log = f"csv[odometry={tmp_path / 'odometry.csv'},ranges={tmp_path / 'ranges.csv'}]"
    *remarked, last = validated(0, log)
    assert any(line.endswith(f": {NO_IDS}.") for line in remarked)
    assert ": can be read, with 1 remark; " in last
    validated(2, "--strict", log)
