import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drawn_errors import run
from fuzzing import survivors
from refusals import refusal, refused
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, between, compose, wrap
from slamduel.core.truth.tum import write_tum
from slamduel.datasets.formats import log_folder
from slamduel.datasets.inertial.open import NOTE as IMU_NOTE
from slamduel.datasets.remarks import remarks
from slamduel.datasets.tables import csv_sightings, csv_tables

DT = 0.1


def csv(path: Path, header: str, rows: Array) -> str:
    path.write_text(header + "\n" + "".join(",".join(repr(float(x)) for x in row) + "\n" for row in rows))
    return str(path)


def drive() -> tuple[Array, Array]:
    """The times (n,) and poses (n, 3) of a robot that goes round twice at 0.5 m/s and 0.4 rad/s."""
    t = DT * np.arange(300.0)
    heading = 0.4 * t
    return t, np.column_stack((1.25 * np.sin(heading), 1.25 * (1 - np.cos(heading)), wrap(heading)))


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Any]:
    """The options of a log of exact files: odometry, detections of two landmarks each second, truth and landmarks."""
    t, poses = drive()
    xy = np.array([[3.0, 1.0], [-2.0, 2.0]])
    rows = list[tuple[float, float, float, float]]()
    for k in range(5, 300, 10):
        for name, place in enumerate(xy):
            x, y = place - poses[k, :2]
            rows.append((t[k], name, np.hypot(x, y), float(wrap(np.arctan2(y, x) - poses[k, 2]))))
    write_tum(tmp_path / "truth.tum", t, poses)
    return {
        "odometry": csv(tmp_path / "odometry.csv", "t,x,y,heading", np.column_stack((t, poses))),
        "detections": csv(tmp_path / "detections.csv", "t,id,range,bearing", np.array(rows)),
        "truth": str(tmp_path / "truth.tum"),
        "landmarks": csv(tmp_path / "landmarks.csv", "id,x,y", np.column_stack((np.arange(2.0), xy))),
    }


def made(options: dict[str, Any]) -> Dataset:
    return csv_tables.make(csv_tables.Options(**options), np.random.default_rng(0))


def test_what_comes_out_is_what_went_in(files: dict[str, Any]) -> None:
    log, truth = made(files)
    assert not list(problems(log))
    assert log.remarks == []
    assert log.name == Path(files["odometry"]).parent.name
    np.testing.assert_array_equal(truth.t, log.t)
    np.testing.assert_allclose(log.delta[1:], between(truth.poses[:-1], truth.poses[1:]), atol=1e-12)
    np.testing.assert_array_equal(log.prior.pose, truth.poses[0])
    assert np.diff(log.t).max() <= 1 + 1e-9
    assert (len(log.ids), len(log)) == (60, 32)  # 30 times of detections, the start and the end
    x, y = (truth.map.xy[log.ids] - truth.poses[log.sighting_step, :2]).T
    np.testing.assert_allclose(log.z[:, 0], np.hypot(x, y), atol=1e-12)


@pytest.mark.parametrize("form", ["t,dx,dy,dtheta", "t,v,omega"])
def test_a_remark_names_the_file_the_lines_of_a_step_and_its_time(files: dict[str, Any], form: str) -> None:
    """The step to 12.5 s is of the rows after 11.5 s; one of these has a jump, and a blank line before it counts."""
    t, poses = drive()
    rows = np.column_stack((t, np.full_like(t, 0.5), np.full_like(t, 0.4)))
    if form == "t,dx,dy,dtheta":
        rows = np.column_stack((t, poses))
        rows[1:, 1:] = between(poses[:-1], poses[1:])
    rows[120, 1] = 3.0 if form == "t,dx,dy,dtheta" else 30.0
    path = Path(csv(Path(files["odometry"]), form, rows))
    path.write_text(path.read_text(encoding="utf-8").replace("\n", "\n\n", 1), encoding="utf-8")
    (said,) = (one for one in remarks(made(files)) if "odometry's dx" in one)
    held = form == "t,v,omega"  # until the next row, so that the row at 11.5 s is in it, too, and that at 12.5 s not
    assert said.endswith(f" m at {path}, lines {119 - held} to {128 - held} (12.5 s)")


@pytest.mark.parametrize("form", ["t,dx,dy,dtheta", "t,v,omega", "heading,comment,y,x,t", "degrees"])
def test_every_form_of_odometry_is_the_same_motion(files: dict[str, Any], tmp_path: Path, form: str) -> None:
    expected = made(files).log
    t, poses = drive()
    rows = np.column_stack((t, poses))
    if form == "t,dx,dy,dtheta":
        rows[1:, 1:] = between(poses[:-1], poses[1:])
        rows[0, 1:] = 7.0  # what came before the first row is nobody's business
    elif form == "t,v,omega":
        rows = np.column_stack((t, np.full_like(t, 0.5), np.full_like(t, 0.4)))
    elif form == "heading,comment,y,x,t":
        rows = np.column_stack((poses[:, 2], t, poses[:, 1], poses[:, 0], t))
    else:
        form, files["angles"] = "t,x,y,heading", "degrees"
        rows[:, 3] = np.degrees(rows[:, 3])
        seen = np.loadtxt(files["detections"], delimiter=",", skiprows=1)
        seen[:, 3] = np.degrees(seen[:, 3])
        csv(Path(files["detections"]), "t,id,range,bearing", seen)
    log = made(files | {"odometry": csv(tmp_path / "other.csv", form, rows)}).log
    np.testing.assert_allclose(log.delta[1:], expected.delta[1:], atol=1e-9)
    np.testing.assert_allclose(log.delta_cov[1:], expected.delta_cov[1:], atol=1e-12)
    np.testing.assert_allclose(log.z, expected.z, atol=1e-12)


@pytest.mark.parametrize("form", ["t,x,y,heading", "t,dx,dy,dtheta", "t,v,omega"])
def test_a_clock_that_stamps_rows_alike_changes_no_motion(files: dict[str, Any], tmp_path: Path, form: str) -> None:
    t, poses = drive()
    motions = np.vstack((np.zeros(3), between(poses[:-1], poses[1:])))
    rows = {"t,x,y,heading": poses, "t,dx,dy,dtheta": motions, "t,v,omega": np.full((len(t), 2), (0.5, 0.4))}[form]
    twice = np.column_stack((t, rows))[np.repeat(np.arange(300), np.where(np.arange(300) % 7 == 3, 2, 1))]
    if form == "t,dx,dy,dtheta":
        again = np.flatnonzero(np.diff(twice[:, 0]) == 0)
        twice[again, 1:] = 0  # the motion comes in two rows, of which one has none
    log = made(files | {"odometry": csv(tmp_path / "twice.csv", form, twice)}).log
    np.testing.assert_allclose(log.delta[1:], made(files).log.delta[1:], atol=1e-9)


@pytest.mark.parametrize("hz", [10, 2, 1])
def test_speeds_at_any_rate_are_the_same_motions_with_the_same_noise(
    files: dict[str, Any], tmp_path: Path, hz: int
) -> None:
    """At 1 Hz a row turns by 0.4 rad: keyframes of 0.2 s within it are on its arc, to an eighth of a chord's turn."""
    expected = made(files | {"every": 0.2}).log
    t = np.arange(30 * hz + 1) / hz
    rows = np.column_stack((t, np.full_like(t, 0.5), np.full_like(t, 0.4)))
    given = files | {"every": 0.2, "odometry": csv(tmp_path / "few.csv", "t,v,omega", rows)}
    log = made(given).log
    both = np.isin(np.round(log.t[1:], 6), np.round(expected.t[1:], 6))
    assert both.sum() > 140
    delta, cov = log.delta[1:][both][:140], log.delta_cov[1:][both][:140]
    np.testing.assert_allclose(delta, expected.delta[1:141], atol=0.05 * 0.02 / 4)
    np.testing.assert_allclose(cov, expected.delta_cov[1:141], atol=0.03 * 0.05**2 * 0.1)


def test_speeds_may_be_those_since_the_row_before_or_at_its_time(files: dict[str, Any], tmp_path: Path) -> None:
    t = np.arange(30.0)
    ramp = np.column_stack((t, 0.1 + 0.01 * t, np.full_like(t, 0.2)))
    before = np.column_stack((t[1:], ramp[:-1, 1:]))
    held, late, middle = (
        made(files | {"odometry": csv(tmp_path / f"{name}.csv", "t,v,omega", rows)} | more).log.delta[1:]
        for name, rows, more in (
            ("held", ramp, {}),
            ("late", np.concatenate((ramp[:1], before)), {"speeds": "since-last"}),
            ("middle", ramp - np.array([0.0, 0.005, 0.0]), {"speeds": "at-time"}),
        )
    )
    np.testing.assert_allclose(late, held, atol=1e-12)
    np.testing.assert_allclose(middle[:-1], held[:-1], atol=1e-12)
    refused(
        "option speeds=at-time of dataset csv: .*odometry.csv has t,x,y,heading, expected t,v,omega, or",
        made, files | {"speeds": "at-time"},
    )  # fmt: skip


def test_points_ahead_and_to_the_left_are_ranges_and_bearings(files: dict[str, Any], tmp_path: Path) -> None:
    expected = made(files).log
    t, ids, r, b = np.loadtxt(files["detections"], delimiter=",", skiprows=1).T
    rows = np.column_stack((t, ids, r * np.cos(b), r * np.sin(b)))
    log = made(files | {"detections": csv(tmp_path / "points.csv", "t,id,x,y", rows)}).log
    np.testing.assert_allclose(log.z, expected.z, atol=1e-12)


def points(files: dict[str, Any], at: Path) -> dict[str, Any]:
    """The options with the detections as points."""
    t, ids, r, b = np.loadtxt(files["detections"], delimiter=",", skiprows=1).T
    return files | {"detections": csv(at, "t,id,x,y", np.column_stack((t, ids, r * np.cos(b), r * np.sin(b))))}


def test_noise_of_x_and_y_is_that_of_range_and_bearing_by_their_derivatives(
    files: dict[str, Any], tmp_path: Path
) -> None:
    log = made(points(files, tmp_path / "points.csv") | {"xy_sd": 0.05}).log
    r, b = log.z.T
    turns = np.array([[np.cos(b), np.sin(b)], [-np.sin(b) / r, np.cos(b) / r]]).transpose(2, 0, 1)
    np.testing.assert_allclose(log.z_cov, turns @ (0.05**2 * np.eye(2)) @ turns.transpose(0, 2, 1), atol=1e-15)
    assert log.notes["noise"]["xy_sd"] == 0.05
    assert "range_sd" not in log.notes["noise"]
    assert log.remarks == []


@pytest.mark.parametrize("times", [0.0, 0.1, 0.4, 0.9, 1.1, 1.7, 2.2, 2.8, 3.5, 6.0, 9.9, 10.1, 30.0])
def test_noise_of_x_and_y_is_that_of_places_around_the_point(times: float) -> None:
    """From right above it, too, where no derivative holds: places are drawn around a point at so many of its sds."""
    places = np.random.default_rng(0).normal((times, 0.0), 1.0, (400_000, 2))
    along, across = csv_sightings.of_points(np.array([0.005 * times]), 0.005)
    drawn = (np.hypot(*places.T) - times) ** 2, np.arctan2(places[:, 1], places[:, 0]) ** 2
    assert along[0] == pytest.approx(0.005**2 * drawn[0].mean(), rel=0.05)
    assert across[0] == pytest.approx(drawn[1].mean(), rel=0.05)


def test_the_remark_on_near_sightings_names_what_the_log_has(files: dict[str, Any], tmp_path: Path) -> None:
    """A landmark is seen from 0.03 m: xy_sd is no option of ranges and bearings, nor of a folder."""
    rows = np.loadtxt(files["detections"], delimiter=",", skiprows=1)
    rows[7, 2] = 0.03
    seen = files | {"detections": csv(tmp_path / "near.csv", "t,id,range,bearing", rows)}

    def advice(dataset: Dataset) -> str:
        (said,) = (one for one in remarks(dataset) if "from within 3 standard deviations" in one)
        return said.rpartition("; ")[2]

    assert (
        advice(made(seen)) == "option bearing_sd is the same at all ranges: t,id,x,y with option xy_sd has that of each"
    )
    places = points(seen, tmp_path / "points.csv")
    assert advice(made(places)) == "option xy_sd states that of x and y, in place of range_sd and bearing_sd"
    assert not [one for one in remarks(made(places | {"xy_sd": 0.05})) if "standard deviations of the range" in one]
    log, truth = made(seen)
    log_folder.write(tmp_path / "log", replace(log, notes={}), truth)
    assert advice(log_folder.read(tmp_path / "log")) == "column cbb of sightings.csv states each bearing's variance"
    assert advice(Dataset(replace(log, notes={}, lines={}), truth)).startswith("a bearing's variance is at least")


def test_noise_of_x_and_y_is_of_points_only(files: dict[str, Any]) -> None:
    refused(
        r"option xy_sd=0.05 of dataset csv: .*t,id,range,bearing, expected t,id,x,y, or", made, files | {"xy_sd": 0.05}
    )


def test_noise_is_as_stated_and_composes(files: dict[str, Any]) -> None:
    stated = {"range_sd": 0.2, "range_share": 0.1, "bearing_sd": 0.3, "forward": 0.04, "turning": 0.0}
    log = made(files | stated | {"turning_by_turn": 0.0, "floor_position": 1e-5, "floor_heading": 1e-5}).log
    np.testing.assert_allclose(log.z_cov[:, 0, 0], (0.2 + 0.1 * log.z[:, 0]) ** 2)
    np.testing.assert_allclose(log.z_cov[:, 1, 1], 0.09)
    whole = np.sqrt(sum(np.trace(cov[:2, :2]) for cov in log.delta_cov[1:]))
    assert whole == pytest.approx(0.04 * np.sqrt(0.5 * 29.9), rel=1e-3)  # 0.04 m per root metre


def test_where_the_robot_starts(files: dict[str, Any]) -> None:
    without = {name: value for name, value in files.items() if name != "truth"}
    np.testing.assert_array_equal(made(without).log.prior.pose, 0)
    started = made(without | {"start_x": 1.0, "start_y": 2.0, "start_heading": 0.5, "start_sd": 0.2}).log.prior
    np.testing.assert_array_equal(started.pose, [1, 2, 0.5])
    np.testing.assert_allclose(started.cov, 0.04 * np.eye(3))
    alone = made(without).truth  # the landmarks are known, the path is not
    assert alone.map is not None
    assert len(alone.t) == 0


def test_the_start_is_that_of_a_truth_that_begins_soon_after(files: dict[str, Any], tmp_path: Path) -> None:
    """As motion capture does; one that begins late, as of the end alone, is in the frame of the start."""
    t, poses = drive()
    frame = np.array([30.0, -20.0, 1.0])
    for first, started in ((0, frame), (7, frame), (60, frame), (299, np.zeros(3))):
        write_tum(tmp_path / "later.tum", t[first:], compose(frame, poses[first:]))
        log = made(files | {"truth": str(tmp_path / "later.tum")}).log
        np.testing.assert_allclose(log.prior.pose, started, atol=1e-9)
    given = files | {"truth": str(tmp_path / "later.tum"), "start_heading": 0.5}
    np.testing.assert_array_equal(made(given).log.prior.pose, [0, 0, 0.5])


def test_position_and_heading_of_the_start_may_be_known_apart(files: dict[str, Any]) -> None:
    cov = made(files | {"start_sd": (100.0, 0.05)}).log.prior.cov
    np.testing.assert_allclose(cov, np.diag([1e4, 1e4, 0.0025]), rtol=1e-12)
    assert made(files | {"start_sd": (100.0, 0.05)}).log.remarks == []
    (remark,) = made(files | {"start_sd": 100.0}).log.remarks
    assert (
        remark == "option start_sd=100 is of the heading in rad, too: start_sd=100,0.1 says that it is known to 0.1 rad"
    )


def test_a_start_somewhere_in_a_large_frame_is_estimated_consistently(files: dict[str, Any], tmp_path: Path) -> None:
    """UTM: the position is off by 100 m, the heading by 0.05 rad, which no single number says."""
    scores = list[tuple[float, float]]()
    for seed in range(6):
        rng = np.random.default_rng(seed)
        t, poses = drive()
        poses = poses + np.array([5e5, 5e6, 0.0])
        write_tum(tmp_path / "truth.tum", t, poses)
        x, y, heading = (poses[0] + rng.normal(0, [100, 100, 0.05])).tolist()
        start = {"start_x": x, "start_y": y, "start_heading": heading, "truth": str(tmp_path / "truth.tum")}
        apart, alike = (run("ekf", made(files | start | {"start_sd": sd}))[1] for sd in ((100.0, 0.05), 0.05))
        scores.append((float(apart.mean()) / 3, float(alike.mean()) / 3))
    apart, alike = np.mean(scores, axis=0)
    assert 0.1 < apart < 3
    assert alike > 100


def test_a_repeated_true_pose_is_read_once_in_either_format(files: dict[str, Any], tmp_path: Path) -> None:
    t, poses = drive()
    rows = np.column_stack((t, poses))
    expected = made(files).truth
    as_csv = csv(tmp_path / "truth.csv", "t,x,y,heading", np.concatenate((rows[:9], rows[8:9], rows[8:])))
    lines = Path(files["truth"]).read_text().splitlines()
    (tmp_path / "twice.tum").write_text("\n".join([*lines[:9], lines[8], *lines[9:]]))
    for path in (as_csv, str(tmp_path / "twice.tum")):
        truth = made(files | {"truth": path}).truth
        assert truth is not None
        assert expected is not None
        np.testing.assert_array_equal(truth.t, expected.t)
        np.testing.assert_allclose(truth.poses, expected.poses, atol=1e-12)
    other = np.concatenate((rows[:9], rows[8:9] + np.eye(4)[1], rows[9:]))
    path = csv(tmp_path / "truth.csv", "t,x,y,heading", other)
    refused("t is 0.8, expected later than 0.8", made, files | {"truth": path})


@pytest.mark.parametrize("header", ["t,x,y,heading", "t,dx,dy,dtheta", "t,v,omega"])
def test_digits_that_g_has_lost_in_times_are_named(header: str, files: dict[str, Any], tmp_path: Path) -> None:
    rows = (f"{1.7e9 + 0.1 * k:g}," + ",".join([f"{0.01 * k:g}"] * header.count(",")) for k in range(300))
    (tmp_path / "odo.csv").write_text(header + "\n" + "\n".join(rows) + "\n")
    refused(
        r"odo\.csv, line 3: t is .*as in the row before.*; all times have six digits or fewer: perhaps %g wrote them",
        made, files | {"odometry": str(tmp_path / "odo.csv")},
    )  # fmt: skip


def test_detections_without_odometry_are_left_out_and_counted(files: dict[str, Any]) -> None:
    path = Path(files["detections"])
    path.write_text(path.read_text() + "99.0,0,1.0,0.1\n")
    log = made(files).log
    assert len(log.ids) == 60
    assert log.notes["dropped"] == {"detections before or after the odometry": 1, "of ignored ids": 0}


def test_ids_that_move_can_be_left_out(files: dict[str, Any]) -> None:
    log = made(files | {"ignore": "1; 77"}).log
    assert set(log.ids.tolist()) == {0}
    assert log.notes["dropped"]["of ignored ids"] == 30
    refused("option ignore=1;x of dataset csv: found 'x'", made, files | {"ignore": "1;x"})
    refused("option odometry of dataset csv is not given", made, {})


def changed(name: str, line: int, row: str) -> Callable[[dict[str, Any]], None]:
    def change(files: dict[str, Any]) -> None:
        lines = Path(files[name]).read_text().splitlines()
        lines[line - 1] = row
        Path(files[name]).write_text("\n".join(lines) + "\n")

    return change


FAULTS: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "header": (changed("odometry", 1, "time,x,y,heading"), "odometry.csv, line 1: found the columns time,x,y,heading,"),
    "twice": (changed("odometry", 1, "t,t,x,y"), "expected t,x,y,heading, or t,dx,dy,dtheta, or t,v,omega among them"),
    "nan": (changed("odometry", 7, "0.5,nan,0,0"), "odometry.csv, line 7: x is nan, expected a finite number"),
    "time": (changed("odometry", 7, "0.3,0,0,0"), "odometry.csv, line 7: t is 0.3, expected no earlier than 0.4"),
    "same": (changed("odometry", 7, "0.4,0,0,0"), "odometry.csv, line 7: t is 0.4 as in the row before, with another"),
    "id": (changed("detections", 3, "0.5,1.5,1,0"), "detections.csv, line 3: id is 1.5, expected a whole number"),
    "negative": (changed("detections", 3, "0.5,-2,1,0"), "detections.csv, line 3: id is -2, expected 0 to"),
    "again": (changed("detections", 3, "0.5,0,1.5,0"), "detections.csv, line 3: id 0 occurs twice at t 0.5"),
    "range": (changed("detections", 3, "0.5,1,0,0"), "detections.csv, line 3: the range is 0.0, expected more than 0"),
    "degrees": (changed("detections", 3, "0.5,1,1,90"), "line 3: bearing is 90.0 radians, expected at most half"),
    "back": (changed("detections", 4, "0.4,1,1,0"), "detections.csv, line 4: t is 0.4, expected no earlier than 0.5"),
    "place": (changed("landmarks", 3, "0,1,1"), "landmarks.csv, line 3: id 0 occurs twice, expected once"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_its_line(files: dict[str, Any], fault: str) -> None:
    change, sentence = FAULTS[fault]
    change(files)
    assert sentence in refusal(made, files)


def test_clocks_without_a_moment_in_common_are_said_so(files: dict[str, Any]) -> None:
    path = Path(files["detections"])
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 0] += 1.7e9
    csv(path, "t,id,range,bearing", rows)
    refused("expected the same clock", made, files)


def test_times_in_nanoseconds_do_not_eat_the_memory(files: dict[str, Any]) -> None:
    for name in ("odometry", "detections"):
        path = Path(files[name])
        header = path.read_text().splitlines()[0]
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        rows[:, 0] *= 1e9
        csv(path, header, rows)
    refused("are the times in seconds", made, files)


@pytest.mark.parametrize("name", ["odometry", "detections", "truth", "landmarks"])
def test_damaged_files_are_read_or_turned_down(files: dict[str, Any], name: str) -> None:
    def fit(found: Dataset) -> None:
        assert not list(problems(found.log))

    read, refused = survivors(lambda _: made(files), Path(files[name]), 100, 3, fit)
    assert read
    assert refused


def test_a_hole_in_the_odometry_is_remarked_and_has_no_regular_keyframes(files: dict[str, Any]) -> None:
    t, poses = drive()
    kept = (t <= 10.3) | (t >= 14.0)
    csv(Path(files["odometry"]), "t,x,y,heading", np.column_stack((t, poses))[kept])
    log, _ = made(files)
    (remark,) = log.remarks
    assert remark.startswith(f"{files['odometry']}: no reading for 3.7 s, from 10.3 to 14 s")
    assert log.t[(log.t > 10.3) & (log.t < 14)].tolist() == pytest.approx([10.5, 11.5, 12.5, 13.5])  # of detections
    sd = np.sqrt(log.delta_cov[1:, 0, 0])
    inside = (log.t[1:] > 10.3) & (log.t[1:] <= 14)
    assert sd[inside].min() > 3 * sd[~inside].max()


@pytest.mark.parametrize("form", ["t,dx,dy,dtheta", "t,v,omega"])
def test_motion_that_is_lost_in_a_hole_is_unknown_after_it(files: dict[str, Any], form: str) -> None:
    t, _ = drive()
    rows = np.column_stack((t, np.tile([0.05, 0.0, 0.04] if "dx" in form else [0.5, 0.4], (len(t), 1))))
    csv(Path(files["odometry"]), form, rows[(t <= 10.3) | (t >= 12.0)])
    log, _ = made(files)
    sd = np.sqrt(log.delta_cov[1:, 0, 0])[(log.t[1:] > 10.3) & (log.t[1:] <= 12.0)]
    assert np.sqrt((sd**2).sum()) == pytest.approx(0.5 * 1.7, rel=0.05)


def test_detections_outside_the_odometrys_time_are_remarked(files: dict[str, Any]) -> None:
    t, poses = drive()
    csv(Path(files["odometry"]), "t,x,y,heading", np.column_stack((t, poses))[t <= 20])
    (remark,) = made(files).log.remarks
    found = "20 of 60 detections (33 %) are before or after the odometry, 0 to 20 s, and left out"
    assert remark == f"{files['detections']}: {found}"


def test_headings_in_degrees_are_remarked_and_read_with_their_option(files: dict[str, Any]) -> None:
    t, poses = drive()
    turned = np.column_stack((t, poses * [1, 1, 180 / np.pi]))
    csv(Path(files["odometry"]), "t,x,y,heading", turned)
    first, *_ = made(files).log.remarks
    assert first.startswith(f"{files['odometry']}: the robot drives along its headings if they are in degrees")
    assert "option angles=odometry reads the headings of this file as degrees" in first
    assert made(files | {"angles": "odometry"}).log.remarks == []
    csv(Path(files["detections"]), "t,id,x,y", np.array([[k, 0, 1, 0] for k in range(1, 20)]))
    assert made(files | {"angles": "degrees"}).log.remarks == []


def test_degrees_may_be_in_some_of_the_files(files: dict[str, Any], tmp_path: Path) -> None:
    """Each remark or refusal names what is in degrees, and the option that reads it so and all else as before."""
    expected = made(files)
    t, poses = drive()
    files["truth"] = csv(tmp_path / "truth_deg.csv", "t,x,y,heading", np.column_stack((t, poses * [1, 1, 180 / np.pi])))
    seen = np.loadtxt(files["detections"], delimiter=",", skiprows=1)
    files["detections"] = csv(tmp_path / "seen_deg.csv", "t,id,range,bearing", seen * [1, 1, 1, 180 / np.pi])
    assert "bearings in degrees take option angles=detections, or angles=degrees if all angles are" in refusal(
        made, files
    )
    first, *_ = made(files | {"angles": "detections"}).log.remarks
    assert first.startswith(files["truth"])
    assert "option angles=detections,truth reads the headings of this file as degrees" in first
    found = made(files | {"angles": "truth;detections"})
    assert found.log.remarks == []
    np.testing.assert_allclose(found.log.z, expected.log.z, atol=1e-12)
    np.testing.assert_allclose(found.truth.poses, expected.truth.poses, atol=1e-12)
    np.testing.assert_array_equal(found.log.delta[1:], expected.log.delta[1:])
    for wrong in ("degree", "landmarks", "truth;;odometry"):
        assert "expected radians, degrees, or the files whose angles are" in refusal(made, files | {"angles": wrong})


@pytest.mark.parametrize("form", ["t,dx,dy,dtheta", "t,v,omega"])
def test_turning_rates_in_degrees_are_remarked_with_their_option(files: dict[str, Any], form: str) -> None:
    t, poses = drive()
    rows = np.full((len(t), 2), (0.5, np.degrees(0.4)))
    if form == "t,dx,dy,dtheta":
        rows = np.vstack((np.zeros(3), between(poses[:-1], poses[1:]))) * [1, 1, 180 / np.pi]
    csv(Path(files["odometry"]), form, np.column_stack((t, rows)))
    first, *_ = made(files).log.remarks
    assert first.endswith("perhaps turning rates are in degrees: option angles=odometry reads them so")
    assert made(files | {"angles": "odometry"}).log.remarks == []


def test_an_option_or_a_column_without_effect_is_remarked(files: dict[str, Any]) -> None:
    assert made(files | {"ignore": "0"}).log.remarks == []
    (remark,) = made(files | {"ignore": "0;99"}).log.remarks
    assert remark == f"option ignore=0;99: {files['detections']} has no detection of id 99, which is to be left out"
    t, poses = drive()
    both = np.column_stack((t, poses, np.full(len(t), 0.5), np.full(len(t), 0.4)))
    csv(Path(files["odometry"]), "t,x,y,heading,v,omega", both)
    (remark,) = made(files).log.remarks
    assert remark == f"{files['odometry']}: has t,v,omega as well as t,x,y,heading, which is used"


def test_positions_and_headings_beyond_any_robot_are_refused(files: dict[str, Any]) -> None:
    t, poses = drive()
    for huge, expected in ((1e20, r"-1e\+09 to 1e\+09"), (1e308, r"a finite number, not beyond 1e\+30")):
        poses[7, 2] = huge
        csv(Path(files["odometry"]), "t,x,y,heading", np.column_stack((t, poses)))
        found = re.escape(str(huge))
        refused(rf"odometry\.csv, line 9: heading is {found}, expected {expected}", made, files)


def test_a_pipe_or_a_device_is_refused_at_once(files: dict[str, Any], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", Path("/dev/zero")):
        for name in ("odometry", "detections", "truth"):
            refused(f"{path}: is a pipe or a device, expected a regular file", made, files | {name: str(path)})


# --- a sensor that is not the robot


def test_detections_of_a_sensor_elsewhere_are_those_of_the_robot(files: dict[str, Any], tmp_path: Path) -> None:
    """The same drive seen by a sensor ahead of the axle, whose clock is late: the same factors to rounding."""
    straight, (t, poses) = made(files).log, drive()
    late, place = 0.25, np.array([0.2, -0.05, 0.3])
    rows = list[tuple[float, ...]]()
    for k in range(5, 300, 10):
        at = compose(poses[k], place)
        for name, xy in enumerate(([3.0, 1.0], [-2.0, 2.0])):
            x, y = between(at, np.array([*xy, at[2]]))[:2]
            rows.append((t[k] + late, name, float(np.hypot(x, y)), float(np.arctan2(y, x))))
    moved = csv(tmp_path / "moved.csv", "t,id,range,bearing", np.array(rows))
    mounting = {"sensor_x": 0.2, "sensor_y": -0.05, "sensor_yaw": 0.3, "sensor_delay": late}
    log = made(files | {"detections": moved} | mounting).log
    assert log.t == pytest.approx(straight.t, abs=1e-12)
    np.testing.assert_array_equal(log.ids, straight.ids)
    assert log.z[:, 0] == pytest.approx(straight.z[:, 0], abs=1e-12)
    assert wrap(log.z[:, 1] - straight.z[:, 1]) == pytest.approx(0, abs=1e-12)
    assert log.delta[1:] == pytest.approx(straight.delta[1:], abs=1e-12)


def with_imu(files: dict[str, Any], at: Path, turn: Array, unit: float, late: float) -> dict[str, Any]:
    """The options with readings of a gyro and an accelerometer at 50 Hz, in their axes and unit, `late` by a clock."""
    t = np.arange(0.0, 29.9, 0.02)
    rate = np.column_stack((0 * t, 0 * t, 0.41 + 0.1 * np.sin(t)))
    up = np.broadcast_to([0.0, 0.0, 9.81], rate.shape)
    rows = np.column_stack((t + late, (rate @ turn) * unit, up @ turn))
    return files | {"imu": csv(at, "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", rows)}


def test_options_say_how_a_gyro_is_mounted_its_unit_and_its_delay(files: dict[str, Any], tmp_path: Path) -> None:
    expected = made(with_imu(files, tmp_path / "right.csv", np.eye(3), 1.0, 0.0)).log
    c, s = np.cos(0.3), np.sin(0.3)
    upside_down = np.diag([1.0, -1.0, -1.0])
    aside = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ upside_down  # of its axes on the robot's
    given = with_imu(files, tmp_path / "other.csv", aside, 180 / np.pi, 0.25)
    told = {"imu_roll": np.pi, "imu_yaw": 0.3, "imu_gyro": "deg/s", "imu_delay": 0.25}
    log = made(given | told).log
    assert log.gyro is not None
    assert expected.gyro is not None
    assert log.remarks == []
    assert "mounted as option imu_roll, imu_pitch or imu_yaw says" in log.notes[IMU_NOTE]
    np.testing.assert_allclose(log.gyro.turn, expected.gyro.turn, atol=1e-9)
    np.testing.assert_allclose(log.gyro.dt, expected.gyro.dt, atol=1e-9)


def test_an_even_turn_without_noise_is_neither_clipped_nor_of_another_unit(
    files: dict[str, Any], tmp_path: Path
) -> None:
    t = np.arange(0.0, 30.0, 0.02)
    rows = np.column_stack((t, 0 * t, 0 * t, np.full(len(t), 0.4)))
    log = made(files | {"imu": csv(tmp_path / "even.csv", "t,gyro_x,gyro_y,gyro_z", rows)}).log
    assert log.gyro is not None
    assert len(log.gyro) == len(log) - 1
    assert not [one for one in log.remarks if "range" in one or ("turns" in one and "rad for each" in one)]


def test_what_nothing_says_of_a_gyro_is_a_remark_that_names_the_options(files: dict[str, Any], tmp_path: Path) -> None:
    given = with_imu(files, tmp_path / "other.csv", np.diag([1.0, -1.0, -1.0]), 180 / np.pi, 0.0)
    said = " ".join(made(given).log.remarks)
    assert "taken to be upside down, and turned back; option imu_roll, imu_pitch or imu_yaw says" in said
    assert "taken to be in degrees/s, and converted; option imu_gyro says" in said
    assert "robot.toml" not in said
