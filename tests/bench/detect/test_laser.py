"""`bench detect` of laser scans: from every kind of bag the same log, and what is told of the matches."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
import command
import floor_drives as floor
from slamduel.bench.cli import main
from slamduel.bench.detect.laser import LaserFindings
from slamduel.bench.plan.load import load
from slamduel.core.factors import Log
from slamduel.datasets.formats import log_folder
from slamduel.datasets.formats.beside_file import read_beside
from square_room import square_room
from tiers import first_quick


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("kind", first_quick(["ros1", "ros2", "mcap"]))
def test_a_bare_bag_runs_and_becomes_the_same_log(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = floor.floor_drive()
    path = floor.bag(tmp_path / "bag", kind, floor.scans(recording), floor.odometry(recording), floor.mounting())
    assert main(["detect", str(path), "--out", str(tmp_path / "log"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["scans"], found["beams"], found["wheels"]) == (169, 181, True)
    assert found["remarks"] == ["there is no sighting and no loop closure in it, so every backend gives dead reckoning"]
    log = log_folder.read(tmp_path / "log").log
    direct, _ = load(str(path))
    assert log.digest == direct.digest
    assert found["steps"] == len(log)
    scans = read_beside(tmp_path / "log", "scans", len(log))
    assert 100 < len(scans.ranges) < 169  # one every 0.1 m or rad
    assert main(["run", "--backend", "dead-reckoning", "--dataset", str(path), "--out", str(tmp_path / "run")]) == 0
    assert "dead-reckoning" in capsys.readouterr().out


def test_the_command_refuses_what_it_cannot_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused = partial(command.refused, capsys, "detect", "--out", tmp_path / "log")
    recording = floor.floor_drive()
    drive = floor.carmen(tmp_path / "drive" / "floor.clf", recording).parent
    (drive / "robot.toml").write_text("[laser]\npose = [0.0, 0.0, 0.0]\n")
    assert "--preview: " in refused(drive, "--preview", tmp_path / "x.mp4")
    assert "has laser scans, expected a camera's recording" in refused(drive, "--calibrate-noise")
    assert "a CARMEN log has no topics" in refused(drive, "--scan", "/scan")
    assert "the robot moved 0 m in 1 scans, expected at least one step" in refused(drive, "--seconds", "0.01")
    (drive / "robot.toml").write_text('[laser]\ngrid = "grids"\n')
    assert "[laser] grid in robot.toml localises on a map, and bench detect makes one" in refused(drive)
    both = [*floor.scans(recording), *(one._replace(topic="/rear") for one in floor.scans(recording))]
    (tmp_path / "two").mkdir()
    assert "/rear (sensor_msgs/LaserScan, 169 messages)" in refused(bags.write(tmp_path / "two", "ros2", both))
    (tmp_path / "broken.mcap").write_bytes(b"nothing")
    assert "is damaged or not a ROS bag" in refused(tmp_path / "broken.mcap")
    assert not (tmp_path / "log").exists()


def findings(**counts: Any) -> LaserFindings:
    """Those of made-up counts."""
    recording = square_room()
    assert recording.odometry is not None
    n = len(recording.t)
    notes = dict.fromkeys(("lost", "relocated", "doubted", "undecided", "by_wheels", "searched", "confirmed"), 0)
    notes |= {"scans": n, "submaps": 2, "wheels": True}
    notes |= {"turned_down": {}, "settings": {"loops": True}, "left_out": "nothing"} | counts
    rows = np.arange(1, n)
    motion = np.tile([0.125, 0.0, 0.0], (n, 1))
    nothing = np.zeros(0, np.int64)
    log = Log.from_arrays(
        "<cart>", recording.prior, recording.t, motion, np.tile(1e-4 * np.eye(3), (n, 1, 1)),
        nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2, 2)), loop_step=rows[5:], loop_to=rows[5:] - 6,
        loop_delta=motion[6:], loop_cov=np.tile(1e-4 * np.eye(3), (n - 6, 1, 1)), notes={"laser": notes},
    )  # fmt: skip
    return LaserFindings(log, None, 8.0, recording, recording.odometry)


def test_what_was_matched_is_told_in_numbers() -> None:
    plain = findings()
    assert plain.headline()[1:] == [
        "Every scan matched the last metres.",
        "The robot never came back to where it had been, so no loop was searched for.",
    ]
    assert plain.advice() == []
    down = {"no place": 1200, "beams through walls": 31}
    found = findings(
        lost=3, relocated=2, doubted=2, undecided=1, by_wheels=2, searched=1234, confirmed=4, turned_down=down
    )
    assert found.headline() == [
        "9 scans of 720 beams in 8.00 s, with wheels: 9 steps over 1.00 m, 3 loop closures.",
        "3 scans did not match the last metres (33 %); the search placed 2 of them elsewhere.",
        "2 times wheels and scans gave more than one place: 1 stays undecided.",
        "2 scans were placed by the wheels: what they were matched to moved along with the robot.",
        (
            "Steps were searched for in earlier submaps 1,234 times: 3 loop closures, 4 of them far from the estimate "
            "and confirmed, and 1,231 turned down."
        ),
    ]
    (said,) = found.advice()
    assert said.startswith("33 % of the scans did not match, and 100 % of the beams are returns between 0.1 and 10 m")
    told = found.as_json("log")
    assert list(told["turned_down"].items()) == [*down.items()]
    json.dumps(told)
