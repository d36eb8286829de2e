"""Numbers beyond all measures in a user's files end in a sentence, or in a log, without a warning of numpy's.

Pytest makes warnings errors.
"""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
import floor_drives as floor
from slamduel.bench.contradiction.remark import remarks
from slamduel.bench.plan.load import load
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset
from slamduel.datasets.readings import read_readings
from slamduel.datasets.recordings.rosbag import Topics, read
from slamduel.datasets.scans.open import open_scans
from slamduel.datasets.truth import read_truth

VALUES = ["1e256", "-1e308", "1e80", "inf", "nan", "1e-320"]
T = 0.1 * np.arange(12)
HEADER = {
    "poses": "t,x,y,heading",
    "motions": "t,dx,dy,dtheta",
    "speeds": "t,v,omega",
    "detections": "t,id,range,bearing",
    "points": "t,id,x,y",
    "ticks": "t,left,right",
    "landmarks": "id,x,y",
}
ROWS: dict[str, Callable[[int], list[float]]] = {
    "poses": lambda k: [T[k], 0.1 * k, 0.02 * k, 0.01 * k],
    "motions": lambda k: [T[k], 0.1, 0.0, 0.01],
    "speeds": lambda k: [T[k], 1.0, 0.1],
    "detections": lambda k: [T[k], k % 3, 2.0, 0.1],
    "points": lambda k: [T[k], k % 3, 2.0, 0.1],
    "ticks": lambda k: [T[k], 100 * k, 110 * k],
    "landmarks": lambda k: [k, 1.0 * k, 2.0],
    "tum": lambda k: [T[k], 0.1 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
}


def table(kind: str) -> list[list[str]]:
    return [[repr(float(x)) if x != int(x) else str(int(x)) for x in ROWS[kind](k)] for k in range(len(T))]


def text(kind: str, rows: list[list[str]]) -> str:
    between = " " if kind == "tum" else ","
    return "\n".join([*([HEADER[kind]] if kind in HEADER else []), *(between.join(row) for row in rows)]) + "\n"


def spoiled(kind: str) -> Iterator[str]:
    """The file with each value in each column of the first, a middle and the last row."""
    for row in (0, 6, len(T) - 1):
        for column in range(len(ROWS[kind](0))):
            for value in VALUES:
                rows = table(kind)
                rows[row][column] = value
                yield text(kind, rows)


def ends(call: Callable[[], Any]) -> None:
    """A call ends, or with a sentence."""
    with contextlib.suppress(InputError):
        found = call()
        if isinstance(found, Dataset):
            remarks(found)


@pytest.mark.parametrize("kind", ["poses", "motions", "speeds", "detections", "points", "landmarks", "tum"])
def test_csv_files(tmp_path: Path, kind: str) -> None:
    name = {"poses": "odometry.csv", "motions": "odometry.csv", "speeds": "odometry.csv", "points": "detections.csv"}
    files = {"odometry.csv": "poses", "detections.csv": "detections", "landmarks.csv": "landmarks", "truth.tum": "tum"}
    for file, good in files.items():
        (tmp_path / file).write_text(text(good, table(good)))
    options = {"odometry.csv": "odometry", "detections.csv": "detections", "landmarks.csv": "landmarks"}
    given = ",".join(f"{option}={tmp_path / file}" for file, option in (options | {"truth.tum": "truth"}).items())
    assert len(load(f"csv[{given}]").log) > 1
    place = tmp_path / name.get(kind, {"tum": "truth.tum"}.get(kind, f"{kind}.csv"))
    for content in spoiled(kind):
        place.write_text(content)
        ends(lambda: load(f"csv[{given}]"))


@pytest.mark.parametrize("kind", ["ticks", "poses", "tum", "landmarks"])
def test_files_beside_frames(tmp_path: Path, kind: str) -> None:
    names = {"ticks": "ticks.csv", "poses": "odometry.csv", "tum": "truth.tum", "landmarks": "landmarks.csv"}
    for content in spoiled(kind):
        (tmp_path / names[kind]).write_text(content)
        ends(lambda: read_readings(tmp_path, 16, []))
        ends(lambda: read_truth(tmp_path))


NUMBERS = [float(value) for value in VALUES]


@pytest.fixture(scope="module")
def said() -> list[bags.Said]:
    drive = floor.floor_drive(laps=0.01)
    return [*floor.scans(drive), *floor.odometry(drive)]


@pytest.mark.parametrize("value", NUMBERS)
def test_scans_odometry_and_tf_of_a_bag(tmp_path: Path, said: list[bags.Said], value: float) -> None:
    odometry = next(one for one in said if one.type == bags.ODOMETRY)
    place = [
        bags.Transform("base_link", "laser", (value, 0.0, 0.3)),
        bags.Transform("base_link", "laser", (0.0, 0.0, 0.3), (0.0, 0.0, value, 1.0)),
        floor.LASER_ON_BASE,
    ]
    for number, transform in enumerate(place):
        fixed = [bags.transforms(floor.BEGIN * floor.NS, transform, topic="/tf_static")]
        others = [] if number < 2 else [one for one in said if one is not odometry]
        others += [bags.odometry(odometry.stamp, value, 0.0, (0.0, 0.0, 0.0, 1.0))] if number == 2 else said
        (tmp_path / str(number)).mkdir()
        path = bags.write(tmp_path / str(number), "mcap", sorted([*others, *fixed], key=lambda one: one.stamp))
        ends(lambda path=path: open_scans(path))


@pytest.mark.parametrize("value", NUMBERS)
def test_odometry_and_counts_of_a_camera_s_bag(tmp_path: Path, value: float) -> None:
    upright = (0.0, 0.0, 0.0, 1.0)
    streams = {
        "x": [bags.odometry(k, value if k == 5 else k, 0.0, upright) for k in range(1, 10)],
        "turn": [bags.odometry(k, k, 0.0, (0.0, 0.0, value, 1.0) if k == 5 else upright) for k in range(1, 10)],
        "counts": [bags.counts(k, value if k == 5 else k, k, k, k) for k in range(1, 10)],
    }
    for name, stream in streams.items():
        (tmp_path / name).mkdir()
        path = bags.write(tmp_path / name, "mcap", [bags.image(1, np.zeros((4, 6), np.uint8)), *stream])
        ends(lambda path=path: read(path, Topics(), 16))


def test_a_scanner_far_from_its_robot_is_refused(tmp_path: Path, said: list[bags.Said]) -> None:
    far = bags.transforms(floor.BEGIN * floor.NS, bags.Transform("base_link", "laser", (0, 1e9, 0)), topic="/tf_static")
    path = bags.write(tmp_path, "mcap", sorted([*said, far], key=lambda one: one.stamp))
    with pytest.raises(InputError, match=r"tf has laser 1e.09 m from base_link, expected at most 100 m between parts"):
        open_scans(path)
