"""Landmarks that move: where the log says they are is where they are, and nothing else of it changes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import slamduel
from drawn_errors import known, seen
from refusals import refused
from slamduel.bench.measure.accuracy import map_accuracy
from slamduel.bench.plan.given_map import read as read_map
from slamduel.core.factors import Dataset, Truth
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, Ints, wrap
from slamduel.core.truth.check import check_truth
from slamduel.core.truth.errors import sighting_errors, standing
from slamduel.datasets import archive
from slamduel.datasets.cache import generator
from slamduel.datasets.formats import log_folder
from slamduel.datasets.truth import PLACES, digest, read_truth
from slamduel.datasets.worlds.circle import Options, circle

EXACT: dict[str, Any] = {"steps": 400, "sighting": 1e-4, "landmarks": 40}


def made(seed: int = 0, **options: Any) -> Dataset:
    dataset = circle(Options(**(EXACT | options)), generator("circle", seed))
    assert not list(problems(dataset.log))
    assert dataset.truth is not None
    check_truth(dataset.log, dataset.truth, "circle")
    return dataset


def moving(dataset: Dataset) -> Ints:
    truth, _ = known(dataset)
    assert truth.moving is not None
    return truth.moving


def tracks(dataset: Dataset) -> dict[int, tuple[Array, Array]]:
    """Landmark -> the times and the places of its sightings, from the true poses."""
    log, truth = dataset
    poses = truth.poses[log.sighting_step]
    bearing = poses[:, 2] + log.z[:, 1]
    xy = poses[:, :2] + log.z[:, :1] * np.stack((np.cos(bearing), np.sin(bearing)), axis=-1)
    rows = {name: log.ids == name for name in np.unique(log.ids).tolist()}
    return {name: (log.t[log.sighting_step][row], xy[row]) for name, row in rows.items()}


def test_a_share_of_the_landmarks_move_and_the_others_stand() -> None:
    _, places = known(made())
    still, moved = made(), made(moving=0.3)
    ids = moving(moved)
    assert 4 <= len(ids) <= 20
    for name, (_, xy) in tracks(moved).items():
        apart = np.hypot(*(xy - places.xy[name]).T)
        assert (apart.max() > 0.1) == (name in ids)
        assert apart[0] < 0.01  # it is where the map has it when it is first sighted
    stands = ~np.isin(still.log.ids, ids)
    np.testing.assert_array_equal(moved.log.z[~np.isin(moved.log.ids, ids)], still.log.z[stands])
    np.testing.assert_array_equal(known(moved)[1].xy, places.xy)
    np.testing.assert_array_equal(moved.log.delta, still.log.delta)


def test_a_landmark_goes_at_its_speed_along_a_line_and_turns_back_at_the_border() -> None:
    moved = made(moving=0.5, moving_speed=0.2, roaming=1.5)
    _, places = known(moved)
    there = tracks(moved)
    fast = list[float]()
    for name in moving(moved):
        if name in there:
            t, xy = there[name]
            off = xy - places.xy[name]
            assert np.abs(off).max() < 1.51
            step = np.hypot(*np.diff(xy, axis=0).T) / np.diff(t)
            assert step.max(initial=0) < 0.21
            fast += step[np.diff(t) == 1].tolist()
    assert np.median(fast) == pytest.approx(0.2, rel=0.02)


def test_stop_and_go_has_both() -> None:
    moved = made(moving=0.5, motion="stop-and-go", moving_speed=0.2, roaming=50.0)
    there, speeds = tracks(moved), list[float]()
    for name in moving(moved):
        if name in there:
            t, xy = there[name]
            assert np.hypot(*(xy[t - t[0] < 5] - xy[0]).T).max() < 0.01  # it stands first
            speeds += (np.hypot(*np.diff(xy, axis=0).T) / np.diff(t)).tolist()
    stood, went = (np.array(speeds) < 0.01).mean(), (np.abs(np.array(speeds) - 0.2) < 0.01).mean()
    assert min(stood, went) > 0.2
    assert stood + went > 0.8


def test_errors_of_sightings_are_those_of_the_log_in_which_all_stand() -> None:
    still, moved = made(sighting=0.05), made(sighting=0.05, moving=1.0, moving_speed=0.0)
    np.testing.assert_allclose(moved.log.z, still.log.z, atol=1e-12)
    assert len(moving(moved)) == 40


def test_a_larger_share_has_the_moving_ones_of_a_smaller_and_they_move_alike() -> None:
    few, many = made(moving=0.2), made(moving=0.6)
    assert set(moving(few).tolist()) < set(moving(many).tolist())
    for name in moving(few):
        if name in tracks(few):
            np.testing.assert_array_equal(tracks(few)[name][1], tracks(many)[name][1])


def test_what_has_moved_out_of_view_is_not_sighted() -> None:
    still, moved = made(), made(moving=1.0, roaming=30.0)
    assert moved.log.z[:, 0].max() <= still.log.z[:, 0].max()
    assert moved.log.notes["faults"]["sightings lost"] == len(still.log.ids) - len(moved.log.ids) > 0


def test_other_faults_stay_what_they_are() -> None:
    """Wrong ids keep their true ones, and lost sightings are those of the log without motion."""
    spoilt: dict[str, Any] = {"wrong_ids": 0.2, "missing": 0.2, "sensor_scale": 2.0, "clutter": 0.3}
    still, moved = made(**spoilt), made(moving=0.3, moving_speed=1e-9, **spoilt)
    np.testing.assert_array_equal(moved.log.ids, still.log.ids)
    np.testing.assert_allclose(moved.log.z, still.log.z, atol=1e-6)
    one, other = known(still)[0].assigned, known(moved)[0].assigned
    np.testing.assert_array_equal(one, other)


def test_landmarks_that_move_have_no_error() -> None:
    log, truth = made(sighting=0.1, moving=0.4)
    assert truth is not None
    places = standing(truth)
    assert truth.map is not None
    assert truth.moving is not None
    assert places is not None
    assert len(places.ids) == 40 - len(truth.moving)
    errors = sighting_errors(log, truth)
    assert not np.isin(log.ids[errors.row], truth.moving).any()
    assert np.abs(errors.values[:, 0]).max() < 0.6
    # A map that has the standing ones right is right, wherever it has the others, and it has to have these.
    off = np.where(np.isin(truth.map.ids, truth.moving)[:, None], 5.0, 0.0)
    found = map_accuracy(log, truth._replace(t=truth.t[:0]), truth.map, truth.map._replace(xy=truth.map.xy + off))
    assert found["map_rmse_m"] == pytest.approx(0, abs=1e-9)
    assert found["landmarks_spurious"] == 0
    assert map_accuracy(log, truth, truth.map, places)["landmarks_missed"] > 0


def test_the_truth_goes_to_the_disk_and_back(tmp_path: Path) -> None:
    for share in (0.3, 1e-9):  # some, or none of them
        log, truth = made(moving=share)
        assert truth is not None
        folder = tmp_path / f"log {share}"
        log_folder.write(folder, log, truth)
        for found in (log_folder.read(folder).truth, archive.unpacked(archive.packed(Dataset(log, truth))).truth):
            assert found is not None
            np.testing.assert_array_equal(found.moving, truth.moving)
            assert digest(found) == digest(truth)
    log, truth = made()
    assert truth is not None
    log_folder.write(tmp_path / "still", log, truth)
    assert (tmp_path / "still" / PLACES).read_text().startswith("id,x,y\n")
    assert digest(truth) != digest(truth._replace(moving=np.zeros(0, np.int64)))


def test_a_file_of_landmarks_says_which_move(tmp_path: Path) -> None:
    path = tmp_path / PLACES
    path.write_text("id,x,y,moving\n1,0,0,0\n2,1,1,1\n3,2,2,0\n")
    found = read_truth(tmp_path)
    assert found.moving.tolist() == [2]
    assert read_map(str(path), fixed=False).maps[0].ids.tolist() == [1, 3]  # what moves is no map to start from
    path.write_text("id,x,y,moving\n1,0,0,0\n2,1,1,0.5\n")
    refused(r"landmarks\.csv, line 3: moving is 0\.5, expected 0 or 1", read_truth, tmp_path)


def test_what_moves_must_be_a_landmark() -> None:
    log, truth = made()
    odd = truth._replace(moving=np.array([3, 99]))
    refused("moving row 1: found 99, expected the id of a landmark of the map", check_truth, log, odd, "log")
    refused("moving row 0: found 3", check_truth, log, Truth(truth.t, truth.poses, moving=np.array([3])), "log")


WORLDS = ("aruco-robot[seconds=10", "bailey[loops=1", "city[steps=60,landmarks=60", "linear[steps=60")


@pytest.mark.parametrize("world", WORLDS)
def test_they_move_in_every_simulated_world(world: str) -> None:
    still, moved = (slamduel.load(f"{world},moving={share}]") for share in (0, 0.5))
    truth, places = known(moved)
    assert truth.moving is not None
    assert 0 < len(truth.moving) < len(places.ids)
    apart = moved.log.z - seen(truth.poses[moved.log.sighting_step], places.xy[moved.log.ids])
    moves = np.isin(moved.log.ids, truth.moving)
    assert np.abs(wrap(apart[moves, 1])).max() > np.abs(wrap(apart[~moves, 1])).max()
    assert not list(problems(moved.log))
    np.testing.assert_array_equal(moved.log.delta, still.log.delta)
