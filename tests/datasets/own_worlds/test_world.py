"""A world from two files: its log, its robot's size, its remarks and refusals, and the options of every world."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat
from scipy.stats import chi2, kstest

import slamduel
from drawn_errors import errors, known
from own_world import LANDMARKS, WAY_POINTS, named, written
from slamduel.core.errors import InputError
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.factors.check import problems
from slamduel.datasets.own_worlds.world import Options, spacing, world
from slamduel.datasets.remarks import remarks
from slamduel.datasets.worlds.matlab_report import FARTHEST, RANGE_NOISE, TAGS, matlab_report
from slamduel.datasets.worlds.matlab_report import Options as Report
from small_run import go

CROWD = "".join(f"{x - 0.5} {y - 0.5}\n" for x in range(-1, 8) for y in range(-1, 8))
"""A landmark every metre, half a metre off the way."""


def made(files: dict[str, str], seed: int = 0, **options: Any) -> Dataset:
    return world(Options(**files, **options), np.random.default_rng(seed))


def refused(files: dict[str, str], **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        made(files, **options)
    return str(caught.value)


def crowd(folder: Path) -> dict[str, str]:
    return written(folder, CROWD)


def test_a_log_has_the_landmarks_and_the_way_points_of_the_files(tmp_path: Path) -> None:
    log, truth = made(written(tmp_path))
    assert not list(problems(log))
    assert log.name == "walk"
    assert set(log.ids) == {5, 8, 9, 12}
    assert truth is not None
    assert truth.map is not None
    np.testing.assert_array_equal(truth.map.ids, [3, 5, 8, 9, 12])
    np.testing.assert_array_equal(truth.poses[0], [0, 0, 0])
    for corner in ([5, 0], [5, 5], [0, 5]):
        near = log.notes["robot"]["near"]
        assert np.hypot(*(truth.poses[:, :2] - corner).T).min() < near + 0.1
    assert made(written(tmp_path)).log.digest == log.digest != made(written(tmp_path), seed=1).log.digest
    assert made(written(tmp_path), loops=2).truth.poses[-1, :2] == pytest.approx(truth.poses[-1, :2], abs=0.05)


def test_the_same_world_in_a_mat_file_is_the_same_log(tmp_path: Path) -> None:
    rows = [[float(cell) for cell in line.split(",")] for line in LANDMARKS.split()[1:]]
    corners = [[float(cell) for cell in line.split(",")] for line in WAY_POINTS.split()[1:]]
    place = tmp_path / "room.mat"
    savemat(place, {"lm": np.array(rows).T[[1, 2, 0]], "wp": np.array(corners).T})
    assert made({"landmarks": str(place), "path": str(place)}).log.digest == made(written(tmp_path)).log.digest


def test_every_error_is_drawn_from_the_stated_covariance(tmp_path: Path) -> None:
    found = [errors(made(crowd(tmp_path), seed)) for seed in range(4)]
    assert kstest(np.concatenate([one.sightings_squared for one in found]), chi2(2).cdf).pvalue > 1e-4
    assert kstest(np.concatenate([one.motions_squared for one in found]), chi2(3).cdf).pvalue > 1e-4


@pytest.mark.parametrize("factor", [0.1, 100.0])
def test_a_larger_world_has_a_larger_robot_so_that_its_drive_is_as_hard(tmp_path: Path, factor: float) -> None:
    files = written(tmp_path / "one")
    wide = written(
        tmp_path / "other",
        "".join(f"{x * factor} {y * factor}\n" for x, y in ((1, 1), (4, 1), (4, 4), (1, 4), (6, 2))),
        "".join(f"{x * factor} {y * factor}\n" for x, y in ((0, 0), (5, 0), (5, 5), (0, 5))),
    )
    one, other = made(files), made(wide)
    assert len(one.log) == len(other.log)
    np.testing.assert_array_equal(one.log.sighting_step, other.log.sighting_step)
    np.testing.assert_allclose(other.log.z_cov[:, 0, 0], factor**2 * one.log.z_cov[:, 0, 0])
    np.testing.assert_allclose(other.log.z_cov[:, 1, 1], one.log.z_cov[:, 1, 1])
    turning = np.sqrt(one.log.delta_cov[1:, 2, 2]), np.sqrt(other.log.delta_cov[1:, 2, 2])
    np.testing.assert_allclose(*turning, rtol=1e-2)
    robot = made(wide, scale=1.0, speed=5.0, view=360.0, reach=200.0).log.notes["robot"]
    assert (robot["range_noise"], robot["speed"], robot["farthest"]) == (RANGE_NOISE, 5.0, 200.0)


def test_the_reports_own_tags_give_its_own_robot() -> None:
    truth, _ = known(matlab_report(Report(tags=12), np.random.default_rng(0)))
    assert spacing(TAGS, truth.poses[:, :2]) == pytest.approx(1.5, rel=0.01)


def test_what_is_in_view_is_seen_and_nothing_else(tmp_path: Path) -> None:
    for view in (84.0, 360.0):
        log, truth = made(crowd(tmp_path), view=view, scale=1.0, nearest=0.0)
        assert truth is not None
        assert truth.map is not None
        d = truth.map.xy[None] - truth.poses[:, None, :2]
        r = np.hypot(d[..., 0], d[..., 1])
        bearing = np.arctan2(d[..., 1], d[..., 0]) - truth.poses[:, None, 2]
        step, row = np.nonzero((r <= FARTHEST) & ((np.cos(bearing) > np.cos(np.deg2rad(42))) | (view == 360)))
        np.testing.assert_array_equal(log.sighting_step, step)
        np.testing.assert_array_equal(log.ids, row)


def test_the_options_of_every_world_hold(tmp_path: Path) -> None:
    text = named(crowd(tmp_path), "clutter=0.5", "wrong_ids=0.1", "missing=0.2", "ids=0.3", "map=surveyed")
    log, truth = slamduel.load(text)
    assert truth is not None
    assert truth.assigned is not None
    assert log.prior.map is not None
    assert len(log.prior.map.ids) == 81
    assert {"false sightings", "sightings lost", "wrong_ids"} <= set(log.notes["faults"])
    assert (log.ids == UNKNOWN).mean() > 0.25
    exact = made(crowd(tmp_path), sensor_scale=0.0)
    assert errors(exact).sightings_squared.max() < 1e-18


def test_a_run_takes_it_with_a_log_per_seed(tmp_path: Path) -> None:
    text = named(crowd(tmp_path / "files"))
    rows = go(tmp_path / "run", "ekf", text, workers=1).values()
    assert [row.columns["status"] for row in rows] == ["done", "done"]
    assert len({row.columns["digest"] for row in rows}) == 2


def test_several_paths_are_several_logs_of_their_own_noise(tmp_path: Path) -> None:
    files = crowd(tmp_path)
    (tmp_path / "walk2.csv").write_text(WAY_POINTS, encoding="utf-8")
    pattern = files | {"path": str(tmp_path / "walk*.csv")}
    logs = [slamduel.load(named(pattern), seed=seed).log for seed in (0, 1)]
    np.testing.assert_array_equal(logs[0].ids, logs[1].ids)
    assert not np.array_equal(logs[0].z, logs[1].z)


def test_a_robot_with_good_wheels_is_not_odd(tmp_path: Path) -> None:
    assert not any("jump" in remark for remark in remarks(made(crowd(tmp_path), wheels=1e-4)))


def test_what_is_odd_is_a_remark_with_its_line(tmp_path: Path) -> None:
    found = " ".join(remarks(made(written(tmp_path))))
    assert f"{tmp_path}/landmarks.csv: 1 of 5 landmarks are never in view, the first in line 2" in found
    files = written(tmp_path, LANDMARKS + "77,4,1\n", "0 0\n0.01 0\n5 0\n4.9 0.5\n")
    found = " ".join(remarks(made(files, scale=1.0)))
    assert "landmarks.csv: the landmarks in line 3 and line 7 are in the same place" in found
    assert "walk.csv: 1 of 4 way points are within near=0.3 m of the robot when it heads for them" in found
    assert "the first in line 2" in found
    assert "too near for the robot to turn towards them, the first in line 4" in found


def test_a_world_that_cannot_be_driven_or_seen_is_refused(tmp_path: Path) -> None:
    files = written(tmp_path)
    assert refused({"path": files["path"]}).startswith(
        "option landmarks of dataset world is not given, expected world["
    )
    assert refused({"landmarks": files["landmarks"]}).startswith("option path of dataset world is not given")
    said = refused(files, reach=0.8, nearest=0.1, scale=1.0)
    assert said.startswith(f"{files['landmarks']}, line 4: no landmark is ever in view; the nearest to the way is this")
    assert "at 1 m, expected one from 0.1 to 0.8 m ahead" in said
    said = refused(written(tmp_path, LANDMARKS, "x,y\n0,0\n5000,0\n5000,8000000\n"), scale=1.0)
    assert said.startswith(f"{files['path']}: the way is 8.005e+06 m long, 133,416,")
    assert "its longest leg is 8e+06 m, to line 4. Is that in metres?" in said
    said = refused(written(tmp_path), period=1000.0)
    assert "m long, expected at least a step" in said
    assert "all way points are within near=30 m of the first" in refused(written(tmp_path), near=30.0)
    assert "expected more than 5 m, the least range" in refused(files, nearest=5.0, reach=4.0)
