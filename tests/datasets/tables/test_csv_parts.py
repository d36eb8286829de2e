"""Ranges, bearings, positions and headings of CSV tables."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refusals import refused, refused_at
from slamduel.core.factors import UNKNOWN, Log, Systematic
from slamduel.core.factors.check import problems
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import Array, wrap
from slamduel.core.truth.errors import sighted_from
from slamduel.datasets.fixes.geodetic import metres
from slamduel.datasets.tables import csv_tables

PLACES = np.array([[3.0, 1.0], [-2.0, 2.0]])


def csv(path: Path, header: str, rows: Array) -> str:
    path.write_text(header + "\n" + "".join(",".join(repr(float(x)) for x in row) + "\n" for row in rows))
    return str(path)


def poses(t: Array) -> Array:
    """(n, 3) round and round at 0.5 m/s and 0.4 rad/s."""
    return np.column_stack((1.25 * np.sin(0.4 * t), 1.25 * (1 - np.cos(0.4 * t)), wrap(0.4 * t)))


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Any]:
    """Exact odometry for 30 s, a range, a bearing, a position and a heading each second at times of their own."""
    t: Array = 0.1 * np.arange(300.0)
    seen = np.arange(1.0, 29.0)
    who = np.arange(28) % 2
    named = who.astype(np.float64)
    right = [sighted_from(poses(seen + off), PLACES[who]) for off in (0.0, 0.25)]
    return {
        "odometry": csv(tmp_path / "odometry.csv", "t,x,y,heading", np.column_stack((t, poses(t)))),
        "ranges": csv(tmp_path / "ranges.csv", "t,id,range", np.column_stack((seen, named, right[0][:, 0]))),
        "bearings": csv(
            tmp_path / "bearings.csv", "t,id,bearing", np.column_stack((seen + 0.25, named, wrap(right[1][:, 1])))
        ),
        "positions": csv(tmp_path / "positions.csv", "t,x,y", np.column_stack((seen + 0.5, poses(seen + 0.5)[:, :2]))),
        "headings": csv(
            tmp_path / "headings.csv", "t,heading", np.column_stack((seen + 0.75, poses(seen + 0.75)[:, 2]))
        ),
        "position_sd": 0.5,
        "start_x": 0.0,
        "start_y": 0.0,
        "start_heading": 0.0,
    }


def made(options: dict[str, Any]) -> Log:
    log = csv_tables.make(csv_tables.Options(**options), np.random.default_rng(0)).log
    assert list(problems(log)) == []
    return log


def test_all_of_them_are_where_and_when_they_were_measured(files: dict[str, Any]) -> None:
    log = made(files | {"range_sd": 0.2, "range_share": 0.1, "bearing_sd": 0.05, "heading_sd": 0.1})
    assert log.remarks == []
    assert len(log.ids) == 0
    table = log.partial
    assert table is not None
    where = poses(log.t[table.step])
    right = sighted_from(where, PLACES[table.ids])
    ranges = table.kind == RANGE
    assert ranges.sum() == (table.kind == BEARING).sum() == 28
    np.testing.assert_allclose(table.z[ranges], right[ranges, 0], atol=1e-12)
    np.testing.assert_allclose(wrap(table.z - right[:, 1])[~ranges], 0, atol=1e-12)
    np.testing.assert_allclose(table.var[ranges], (0.2 + 0.1 * table.z[ranges]) ** 2)
    assert set(table.var[~ranges].tolist()) == {0.05**2}
    fixes = log.fixes
    assert fixes is not None
    at = np.isnan(fixes.z[:, 2])
    where = poses(log.t[fixes.step])
    np.testing.assert_allclose(fixes.z[at, :2], where[at, :2], atol=1e-12)
    np.testing.assert_allclose(wrap(fixes.z[~at, 2] - where[~at, 2]), 0, atol=1e-12)
    assert fixes.cov[at][0, 0, 0] == 0.25
    assert fixes.cov[~at][0, 2, 2] == pytest.approx(0.01)
    assert log.prior.systematic == Systematic()


def test_options_say_where_the_antenna_is_and_what_stays(files: dict[str, Any]) -> None:
    log = made(
        files | {"antenna_x": 0.3, "antenna_y": -0.1, "range_scale": 0.1, "range_offset": 0.5, "heading_offset": 0.2}
    )
    assert log.fixes is not None
    at = np.isnan(log.fixes.z[:, 2])
    assert (log.fixes.arm[at] == [0.3, -0.1]).all()
    assert not log.fixes.arm[~at].any()
    assert log.prior.systematic == Systematic(0.1, 0.5, 0.2)


def test_a_column_has_the_noise_of_each_row(files: dict[str, Any], tmp_path: Path) -> None:
    rows = np.array([[1.0, 0, 0, 2.0], [2.0, 1, 1, 3.0]])
    log = made(files | {"positions": csv(tmp_path / "p.csv", "t,x,y,sd", rows), "position_sd": None})
    assert log.fixes is not None
    at = np.isnan(log.fixes.z[:, 2])
    assert log.fixes.cov[at][:, 0, 0].tolist() == [4.0, 9.0]


def test_a_compass_turns_the_other_way_from_north(files: dict[str, Any], tmp_path: Path) -> None:
    t = np.arange(1.0, 20.0)
    bearing = np.pi / 2 - poses(t)[:, 2] - 0.2  # magnetic north is 0.2 rad east of north
    degrees = csv(tmp_path / "h.csv", "t,heading", np.column_stack((t, np.degrees(bearing) % 360)))
    compass = {
        "headings": degrees,
        "headings_from": "north",
        "declination": 0.2,
        "angles": "headings",
        "positions": None,
    }
    log = made(files | compass)
    assert log.fixes is not None
    np.testing.assert_allclose(wrap(log.fixes.z[:, 2] - poses(log.t[log.fixes.step])[:, 2]), 0, atol=1e-9)


def test_degrees_of_latitude_become_metres(files: dict[str, Any], tmp_path: Path) -> None:
    """A minute of latitude is a nautical mile, 1852 m, within 0.5 %; of longitude at 60 degrees half of it."""
    moved = metres(np.array([[60.0, 25.0], [60 + 1 / 60, 25.0], [60.0, 25 + 1 / 60]]), np.array([60.0, 25.0]))
    np.testing.assert_allclose(moved, [[0, 0], [0, 1852], [926, 0]], rtol=6e-3, atol=1e-6)
    np.testing.assert_allclose(metres(np.array([[0.0, -179.999]]), np.array([0.0, 179.999])), [[222.64, 0]], rtol=1e-4)
    gps = csv(tmp_path / "gps.csv", "t,lat,lon", np.array([[1, 49.0, 8.4], [2, 49.0001, 8.4]]))
    log = made(files | {"positions": gps, "headings": None})
    assert log.fixes is not None
    np.testing.assert_allclose(log.fixes.z[:, :2], [[0, 0], [0, 11.12]], atol=0.01)
    assert log.notes["origin"] == "latitude and longitude 49, 8.4, x being east and y north"
    (remark,) = log.remarks
    assert "x and y are metres east and north of its first fix, latitude and longitude 49, 8.4" in remark
    stated = made(files | {"positions": gps, "headings": None, "origin_lat": 48.9999, "origin_lon": 8.4})
    assert stated.fixes is not None
    assert stated.remarks == []
    np.testing.assert_allclose(stated.fixes.z[0, :2], [0, 11.12], atol=0.01)


def test_a_start_that_nobody_gave_is_remarked(files: dict[str, Any]) -> None:
    (remark,) = made(files | {"start_heading": None}).remarks
    assert "the start there is not known: start_x and start_y are given, but not start_heading; start_sd" in remark
    (one,) = made(files | {"start_x": None, "start_y": None}).remarks
    assert "not known: start_heading is given, but not start_x, start_y; start_sd states how well" in one
    (none,) = made(files | {"start_x": None, "start_y": None, "start_heading": None}).remarks
    assert none.endswith("not known: options start_x, start_y, start_heading and start_sd state it")
    assert made(files | {"start_heading": None, "start_sd": (100.0, 3.0)}).remarks == []


@pytest.mark.parametrize("name", ["positions", "headings", "ranges", "bearings"])
def test_a_row_that_is_repeated_is_left_out_with_a_remark(files: dict[str, Any], name: str) -> None:
    right = made(files)
    assert right.remarks == []
    path = Path(files[name])
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:5], lines[4], *lines[5:]]) + "\n")
    log = made(files)
    assert log.remarks == [f"{path}, line 6: repeats line 5, its time, too: it is left out"]
    assert log.digest == right.digest


def test_a_motion_that_is_repeated_is_remarked_but_none_of_a_coarse_clock(
    files: dict[str, Any], tmp_path: Path
) -> None:
    rows = np.column_stack(
        (0.1 * np.arange(300.0), np.full((300, 1), 0.05), np.zeros((300, 1)), np.full((300, 1), 0.04))
    )
    path = csv(tmp_path / "motions.csv", "t,dx,dy,dtheta", np.insert(rows, 50, rows[49], axis=0))
    (remark,) = made(files | {"odometry": path}).remarks
    assert remark == f"{path}, line 52: repeats line 51, so its motion counts twice; expected once"
    coarse = rows.copy()
    coarse[:, 0] = 0.2 * (np.arange(300) // 2)
    coarse[1::4, 1] += 0.001
    path = csv(tmp_path / "coarse.csv", "t,dx,dy,dtheta", coarse)
    assert made(files | {"odometry": path}).remarks == []


def test_what_is_outside_the_odometry_is_left_out_and_remarked(files: dict[str, Any], tmp_path: Path) -> None:
    late = csv(tmp_path / "late.csv", "t,id,range", np.array([[5.0, 0, 2.0], [45.0, 0, 2.0]]))
    log = made(files | {"ranges": late})
    assert log.partial is not None
    assert (log.partial.kind == RANGE).sum() == 1
    assert any("late.csv" in remark for remark in log.remarks)
    assert log.notes["dropped"]["other measurements before or after it"] == 1


def test_an_unknown_landmark_may_be_seen_twice(files: dict[str, Any], tmp_path: Path) -> None:
    twice = csv(tmp_path / "twice.csv", "t,id,bearing", np.array([[5.0, -1, 0.2], [5.0, -1, 0.4]]))
    log = made(files | {"bearings": twice, "ranges": None})
    assert log.partial is not None
    assert log.partial.ids.tolist() == [UNKNOWN, UNKNOWN]


FAULTS: dict[str, tuple[str, str, Any, str]] = {
    "a range below zero": ("ranges", "t,id,range", [[1, 0, 2], [2, 0, -1]], "line 3: the range is -1.0, expected more"),
    "an id twice": (
        "ranges",
        "t,id,range",
        [[1, 0, 2], [1, 0, 3]],
        "line 3: id 0 occurs twice at t 1.0, expected once",
    ),
    "a bad id": ("bearings", "t,id,bearing", [[1, -7, 0.2]], "line 2: id is -7, expected 0 to"),
    "degrees": (
        "bearings",
        "t,id,bearing",
        [[1, 3, 90]],
        "line 2: bearing is 90.0 radians, expected at most half a turn",
    ),
    "no id": ("bearings", "t,bearing", [[1, 0.2]], "line 1: found the columns t,bearing, expected t,id,bearing"),
    "a heading in degrees": (
        "headings",
        "t,heading",
        [[1, 90]],
        "line 2: heading is 90.0 radians, expected at most a turn",
    ),
    "no noise": ("positions", "t,x,y,sd", [[1, 2, 3, 0]], "line 2: sd is 0.0, expected a standard deviation"),
    "no latitude": ("positions", "t,lat,lon", [[1, 91, 3]], "line 2: lat is 91.0, expected -90 to 90"),
    "back in time": ("positions", "t,x,y", [[2, 0, 0], [1, 0, 0]], "line 3: t is 1.0, expected no earlier than 2.0"),
    "too far": ("positions", "t,x,y", [[2, 1e12, 0]], "line 2: x is 1000000000000.0, expected"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_named(files: dict[str, Any], tmp_path: Path, case: str) -> None:
    name, header, rows, said = FAULTS[case]
    path = tmp_path / "bad.csv"
    csv(path, header, np.array(rows, float))
    refused_at(path, said, made, files | {name: str(path)})


REFUSED: dict[str, tuple[Callable[[dict[str, Any]], dict[str, Any]], str]] = {
    "no noise": (
        lambda f: f | {"position_sd": None},
        "option position_sd of dataset csv is not given, and .* no column sd",
    ),
    "half an origin": (lambda f: f | {"origin_lat": 3.0, "positions": f["globe"]}, "found one, expected both or none"),
    "nothing": (
        lambda f: {"odometry": f["odometry"]},
        "found odometry alone, expected what the robot measured",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_an_option_that_is_missing_is_named(files: dict[str, Any], tmp_path: Path, case: str) -> None:
    change, said = REFUSED[case]
    globe = csv(tmp_path / "globe.csv", "t,lat,lon", np.array([[1.0, 2, 3]]))
    found = change(files | {"globe": globe})
    found.pop("globe", None)
    refused(said, made, found)


def test_all_wrong_lines_are_named_the_first_one_first(files: dict[str, Any], tmp_path: Path) -> None:
    rows = [[1, 0, 2], [2, 0, -1], [3, 0, np.nan], [4, 0.5, 1], [5, 0, 0], [6, 0, 0], [7, 0, 0], [8, 0, 0]]
    path = tmp_path / "bad.csv"
    csv(path, "t,id,range", np.array(rows, float))
    said = (
        "line 3: the range is -1.0, expected more than 0; line 4: range is nan, expected a finite number; line 5: id "
        "is 0.5, expected a whole number up to 9007199254740992; line 6: the range is 0.0, expected more than 0; line "
        "7: the range is 0.0, expected more than 0; and 2 more lines."
    )
    refused_at(path, said, made, files | {"ranges": str(path)})


def test_a_time_far_ahead_of_the_next_ones_is_named_itself(files: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    csv(path, "t,id,range", np.array([[1, 0, 2], [2, 0, 2], [20, 0, 2], [3, 0, 2], [4, 0, 2]], float))
    refused_at(path, "line 4: t is 20.0, but the next, line 5, has 3.0", made, files | {"ranges": str(path)})


def test_times_in_milliseconds_are_said_so(files: dict[str, Any], tmp_path: Path) -> None:
    seen = np.arange(28.0)
    late = csv(tmp_path / "ms.csv", "t,id,range", np.column_stack((1000 * seen, 0 * seen, 2 + 0 * seen)))
    (said,) = made(files | {"ranges": late}).remarks
    assert "27 of 28 ranges (96 %) are before or after the odometry" in said
    assert said.endswith("left out: perhaps they are in milliseconds, 1,000 to the second")


@pytest.mark.parametrize("off", [1.7e9, 5000.0])
def test_seconds_of_another_clock_are_no_other_unit(files: dict[str, Any], tmp_path: Path, off: float) -> None:
    seen = np.arange(28.0)
    late = csv(tmp_path / "unix.csv", "t,id,range", np.column_stack((off + seen, 0 * seen, 2 + 0 * seen)))
    (said,) = made(files | {"ranges": late}).remarks
    assert "28 of 28 ranges (all) are before or after the odometry" in said
    assert said.endswith(f"left out: the clocks differ, these times begin {off:,.0f} s later")


@pytest.mark.parametrize("off", [0.002, 0.09])
def test_a_bearing_that_noise_brings_beyond_half_a_turn_is_wrapped(
    files: dict[str, Any], tmp_path: Path, off: float
) -> None:
    rows = np.array([[5.0, 0, np.pi + off], [6.0, 0, -np.pi - off], [7.0, 0, -np.pi]])
    log = made(files | {"ranges": None, "bearings": csv(tmp_path / "b.csv", "t,id,bearing", rows)})
    assert log.partial is not None
    np.testing.assert_allclose(log.partial.z, [off - np.pi, np.pi - off, -np.pi], atol=1e-12)
    rows[0, 2] = np.pi + 0.2  # beyond 0.1 rad, and six times the noise of 0.02
    path = tmp_path / "b.csv"
    csv(path, "t,id,bearing", rows)
    refused_at(path, "line 2: bearing is 3.34", made, files | {"ranges": None, "bearings": str(path)})


def test_a_position_with_latitude_and_longitude_swapped_is_named(files: dict[str, Any], tmp_path: Path) -> None:
    rows = np.array([[k, 48.1 + 1e-6 * k, 11.5 + 2e-6 * k] for k in range(1, 8)])
    good = made(files | {"positions": csv(tmp_path / "good.csv", "t,lat,lon", rows)})
    assert not [one for one in good.remarks if "line" in one]
    rows[2, 1:] = rows[2, :0:-1]
    path = csv(tmp_path / "swap.csv", "t,lat,lon", rows)
    (said,) = [one for one in made(files | {"positions": path}).remarks if "line" in one]
    assert said.startswith(f"{path}, line 4: the position 11.500006, 48.100003 is ")
    assert " km from the middle of the others" in said
    assert said.endswith("perhaps lat and lon are swapped in this row")
    rows[2, 1:] = 50.0, 11.5
    path = csv(tmp_path / "far.csv", "t,lat,lon", rows)
    (said,) = [one for one in made(files | {"positions": path}).remarks if "line" in one]
    assert "line 4" in said
    assert "swapped" not in said
