"""`bench show`: its numbers against those worked out by hand, and its picture of all kinds of logs."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

import slamduel
from slamduel.bench import cli
from slamduel.bench.check.log_recipe import made_log
from slamduel.bench.check.small_logs import around
from slamduel.bench.logs import shown_path
from slamduel.bench.logs.facts import facts, headline
from slamduel.bench.logs.numbers import Numbers, numbers
from slamduel.bench.logs.revisits import returns
from slamduel.bench.logs.shown_path import from_pose, shown
from slamduel.bench.measure.landmark_places import judge
from slamduel.bench.measure.stated_noise import NoiseCheck, noise_check
from slamduel.core.factors import UNKNOWN, Dataset, Log, Map, Prior, Truth
from slamduel.core.se2 import compose
from slamduel.core.truth.errors import odometry_errors, sighting_errors
from slamduel.datasets.formats import log_folder
from tiers import first_quick


def log_of(n: int, step: Any = (), ids: Any = (), z: Any = None, **more: Any) -> Log:
    """Of `n` steps that each go 10 m ahead and turn left by a right angle, 2 s apart; sd 0.2 m, 0.1 rad, 0.1 m."""
    s = len(ids)
    given: dict[str, Any] = {
        "t": 2.0 * np.arange(n),
        "delta": np.tile((10.0, 0.0, np.pi / 2), (n, 1)),
        "delta_cov": np.tile(np.diag((0.01, 0.04, 0.0025)), (n, 1, 1)),
        "z": np.tile((1.0, 0.0), (s, 1)) if z is None else np.asarray(z, float),
        "z_cov": np.tile(np.diag((0.04, 0.01)), (s, 1, 1)),
    }
    prior = Prior(np.array((1.0, 2.0, 0.5)), 1e-6 * np.eye(3))
    return Log.from_arrays(
        "small", prior, sighting_step=np.array(step, int), ids=np.array(ids, int), **{**given, **more}
    )


def twice_round() -> Log:
    """Two rounds of a square of 10 m, landmark 7 seen at its first corner and 9 at its second; a pause at the end."""
    t = 2.0 * np.arange(9)
    t[8] += 18
    return log_of(9, (0, 1, 2, 4, 5, 8), (7, 9, UNKNOWN, 7, 9, 7), t=t)


def only_loops() -> Log:
    one = np.diag((1e-4, 1e-4, 1e-4))[None]
    return log_of(
        5, loop_step=np.array([4]), loop_to=np.array([0]), loop_delta=np.array([[0.1, 0.0, 0.0]]), loop_cov=one
    )


def measured(log: Log, truth: Truth | None = None) -> Numbers:
    dataset = Dataset(log, truth)
    return numbers(dataset, shown(dataset, solve=False), returns(log))


def test_the_way_and_the_times_are_those_worked_out_by_hand() -> None:
    found = measured(twice_round())
    assert found.way.steps == 9
    assert found.way.odometry_m == pytest.approx(80)
    assert found.way.known_m is None
    assert found.way.speed == pytest.approx(80 / 34)
    assert found.way.turned == pytest.approx(4 * np.pi)
    assert found.way.turned_left == pytest.approx(4 * np.pi)
    assert found.times == pytest.approx((34, 2, 20, 1))


def test_the_sightings_and_landmarks_are_those_worked_out_by_hand() -> None:
    found = measured(twice_round())
    seen = found.seen
    assert (seen.sightings, seen.unknown, seen.most, seen.steps_without, seen.longest_without) == (6, 1, 1, 3, 2)
    assert seen.mean == pytest.approx(6 / 9)
    assert (seen.p5, seen.p50, seen.p95) == (0, 1, 1)
    assert seen.longest_without_m == pytest.approx(30)  # from step 5 to step 8
    assert seen.longest_without_s == pytest.approx(24)
    assert found.landmarks == (2, 2, 2.5, 3, 0)


def test_the_returns_are_those_worked_out_by_hand() -> None:
    back = measured(twice_round()).back
    # 7 after 0-4 and 4-8, 9 after 1-5, 40 m each; 1-5 overlaps 0-4, so that there are two loops one after another.
    assert (back.loops, back.returns, back.landmarks, back.longest_steps, back.closures) == (2, 3, 2, 4, 0)
    assert back.after_m == 2.0  # two median ranges
    assert back.longest_m == pytest.approx(40)
    found = returns(twice_round())
    assert found.rank.tolist() == [0, 1, 0, 1, 0]
    assert found.visit.tolist() == [0, 0, 1, 1, 2]
    assert found.before.tolist() == [-1, -1, 0, 1, 4]


def test_a_flicker_of_the_sensor_is_no_return() -> None:
    far = np.tile((30.0, 0.0), (3, 1))  # an absence needs 60 m of way
    assert measured(log_of(9, (0, 4, 8), (7, 7, 7), far)).back.returns == 0


def test_a_robot_that_goes_round_five_times_closes_four_loops() -> None:
    n = 100
    log = log_of(
        n, np.arange(n), np.arange(n) % 20, delta=np.tile((1.0, 0.0, 2 * np.pi / 20), (n, 1))
    )  # fmt: skip
    assert measured(log).back.loops == 4


def test_without_ids_nothing_tells_whether_it_comes_back() -> None:
    log = twice_round()
    hidden = measured(replace(log, ids=np.full(len(log.ids), UNKNOWN)))
    assert headline(hidden).endswith("whether it comes back cannot be told without ids")
    assert headline(measured(log)).endswith("comes back twice")


def test_the_stated_noise_is_that_of_a_step_and_of_a_metre() -> None:
    noise = measured(twice_round()).noise
    assert noise.range.median == pytest.approx(0.2)
    assert noise.range.constant
    assert noise.sideways.median == pytest.approx(0.2)
    assert noise.forward_1m == pytest.approx(np.sqrt(8 * 0.01 / 80))
    cov = np.stack([np.diag((v, 0.01)) for v in (0.01, 0.04, 0.09)])
    varying = measured(log_of(3, (0, 1, 2), (1, 1, 1), z_cov=cov)).noise.range
    assert varying.median == pytest.approx(0.2)
    assert not varying.constant


@pytest.mark.parametrize("middle", [0.0, 1.0, 3.1, -3.0])
def test_the_field_of_view_goes_round_behind_the_robot_too(middle: float) -> None:
    bearings = middle + np.linspace(-0.4, 0.4, 401)
    bearings[7] = middle + 2.0  # one of 401 does not widen it
    bearings = np.angle(np.exp(1j * bearings))
    sensor = measured(log_of(401, np.arange(401), np.full(401, 1), np.column_stack((np.ones(401), bearings)))).sensor
    assert sensor.view == pytest.approx(0.8, abs=0.01)
    assert np.angle(np.exp(1j * (sensor.view_right + sensor.view / 2 - middle))) == pytest.approx(0, abs=0.01)
    assert np.angle(np.exp(1j * (sensor.view_left - sensor.view_right - sensor.view))) == pytest.approx(0, abs=1e-9)


def test_dead_reckoning_is_the_motions_one_after_another() -> None:
    rng = np.random.default_rng(3)
    log = log_of(40, delta=rng.normal(size=(40, 3)))
    path = [log.prior.pose]
    for delta in log.delta[1:]:
        path.append(compose(path[-1], delta))
    np.testing.assert_allclose(log.dead_reckoned(), path, atol=1e-12)
    moved = from_pose(np.array(path), 5, np.array((9.0, 8.0, 7.0 - 2 * np.pi)))
    np.testing.assert_allclose(moved[5], (9, 8, 7 - 2 * np.pi), atol=1e-12)
    np.testing.assert_allclose(moved[6], compose(moved[5], log.delta[6]), atol=1e-12)


@pytest.mark.parametrize("errors", [1.0, 2.0])
def test_honest_noise_is_told_from_noise_stated_too_small(errors: float) -> None:
    made = made_log(np.random.default_rng(4), around(600), errors=errors)
    truth = Truth(made.log.t, made.path, made.map, None, "truth")
    known = measured(made.log, truth).known
    for honest, k in ((known.sightings, 2), (known.odometry, 3)):
        tolerance = 6 * np.sqrt(2 / k / honest.checked)  # chi-square's variance is twice its mean
        assert honest.nees / errors**2 == pytest.approx(1, abs=tolerance)
        assert honest.scale == pytest.approx(errors, rel=6 / np.sqrt(honest.checked))
    words = dict(facts(measured(made.log, truth), "truth"))
    assert words["sightings against truth"].startswith("typical error as stated" if errors == 1 else "stated too small")


def test_errors_are_measured_minus_true_where_the_truth_reaches() -> None:
    log = log_of(3, (0, 1, 2), (5, 5, 6), [[3.2, 0.1], [2.0, 0.0], [1.0, 0.0]])
    poses = np.array(((0, 0, 0), (10, 0, np.pi / 2)), float)
    truth = Truth(log.t[:2], poses, Map(np.array([4, 5]), np.array(((10.0, 2.5), (3.0, 0.0))), None), None, "truth")
    found = sighting_errors(log, truth)
    assert found.row.tolist() == [0, 1]
    np.testing.assert_allclose(found.values[0], (0.2, 0.1), atol=1e-12)
    renamed = sighting_errors(log, truth._replace(assigned=np.array([5, 4, UNKNOWN])))
    np.testing.assert_allclose(renamed.values[1], (-0.5, 0.0), atol=1e-12)  # of landmark 4, 2.5 m straight ahead
    odometry = odometry_errors(log, truth)
    assert odometry.row.tolist() == [1]
    np.testing.assert_allclose(odometry.values, np.zeros((1, 3)), atol=1e-12)
    judged = noise_check(found, log.z_cov)
    first = 0.2**2 / 0.04 + 0.1**2 / 0.01
    second = found.values[1] ** 2 @ (1 / 0.04, 1 / 0.01)
    assert judged.nees == pytest.approx((first + second) / 2 / 2)


def test_drift_is_from_the_first_known_pose_to_the_last() -> None:
    log = log_of(4, delta=np.tile((1.0, 0.0, 0.0), (4, 1)))
    poses = np.array(((5, 5, 0), (5.9, 5, 0), (6.8, 5.0, 0)))  # 1.8 m, of which odometry makes 2
    known = measured(log, Truth(log.t[1:], poses, None, None, "truth")).known
    assert (known.kind, known.steps, known.landmarks, known.sightings) == ("truth", 3, 0, None)
    assert known.drift_m == pytest.approx(0.2)
    assert known.drift_share == pytest.approx(0.2 / 1.8)


def test_a_reference_is_no_truth_to_judge_noise_by() -> None:
    made = made_log(np.random.default_rng(4))
    known = measured(made.log, Truth(made.log.t, made.path, made.map, None, "reference")).known
    assert known.kind == "reference"
    assert known.sightings is None
    assert known.odometry is None


def test_without_truth_the_batch_optimum_is_drawn_and_of_a_large_log_dead_reckoning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = made_log(np.random.default_rng(4), errors=3.0)
    solved = shown(Dataset(made.log, None), None)
    assert "batch optimum" in solved.words

    def off(path: Any) -> float:
        return float(np.hypot(*(path - made.path)[:, :2].T).max())

    assert off(solved.poses) < 0.5 * off(made.log.dead_reckoned())
    monkeypatch.setattr(shown_path, "LARGEST", 10)
    plain = shown(Dataset(made.log, None), None)
    assert plain.words == "dead reckoning; --solve finds the batch optimum"
    np.testing.assert_array_equal(plain.poses, made.log.dead_reckoned())
    assert "batch optimum" in shown(Dataset(made.log, None), True).words
    # Placed from the path that is drawn, a landmark is near where it is.
    order = np.argsort(made.map.ids)
    close = shown(Dataset(made.log, Truth(made.log.t, made.path, None, None, "truth")), None)
    assert len(close.xy) == len(order)
    assert np.hypot(*(close.xy - made.map.xy[order]).T).max() < 0.3


LOGS = {
    "plain": (twice_round, "9 steps, 80.0 m, 34.0 s, 6 sightings of 2 landmarks, comes back twice"),
    "silent": (
        lambda: log_of(3),
        "3 steps, 20.0 m, 4.00 s, 0 sightings, neither a landmark nor a loop closure tells if it comes back",
    ),
    "single": (lambda: log_of(1, (0,), (3,)), "1 step, 0 m, 1 sighting of 1 landmark, never comes back"),
    "empty": (
        lambda: log_of(1),
        "1 step, 0 m, 0 sightings, neither a landmark nor a loop closure tells if it comes back",
    ),
    "loops": (only_loops, "5 steps, 40.0 m, 8.00 s, 0 sightings, 1 loop closure, comes back once"),
    "nameless": (
        lambda: log_of(3, (0, 2), (-1, -1)),
        "3 steps, 20.0 m, 4.00 s, 2 sightings, whether it comes back cannot be told without ids",
    ),
    "numbered": (
        lambda: log_of(4, (0, 3), (1, 1), t=np.arange(4.0), delta=np.zeros((4, 3))),
        "4 steps, 0 m, 2 sightings of 1 landmark, never comes back",
    ),
}


@pytest.mark.parametrize("name", first_quick(LOGS, 3))
def test_every_kind_of_log_has_its_numbers_and_its_picture(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make, words = LOGS[name]
    monkeypatch.chdir(tmp_path)
    log_folder.write(tmp_path / name, make(), None)
    assert cli.main(["show", f"./{name}"]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert " ".join(said.out.split()).startswith(f"{name}: {words} ")
    assert f"picture: {name}-log.png" in said.out
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([name, f"{name}-log.png"])
    _not_blank(tmp_path / f"{name}-log.png")


def test_a_log_with_truth_for_some_steps_and_one_with_landmarks_alone_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    made = made_log(np.random.default_rng(4))
    kept = np.r_[5:20, 40:50]
    log_folder.write(tmp_path / "gap", made.log, Truth(made.log.t[kept], made.path[kept], made.map, None, "truth"))
    assert cli.main(["show", "gap"]) == 0
    assert "the true pose of 25 steps of" in " ".join(capsys.readouterr().out.split())
    _not_blank(tmp_path / "gap-log.png")
    dataset = Dataset(made.log, Truth(np.zeros(0), np.zeros((0, 3)), made.map, None, "truth"))
    drawn = shown(dataset, None)
    assert "batch optimum" in drawn.words
    known = numbers(dataset, drawn, returns(made.log)).known
    assert (known.kind, known.landmarks, known.sightings) == ("reference", len(made.map.ids), None)


def test_json_is_all_that_is_printed_and_draws_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["show", "circle[steps=300]", "--seed", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["log"], found["seed"], found["path"]) == ("circle[steps=300]", 1, "truth")
    assert found["way"]["steps"] == 300
    assert 0.8 < found["known"]["sightings"]["nees"] < 1.2
    assert found["times"] is None
    assert found["known"]["scattered"] is None
    # 0.1 m across the line of sight, at ranges of 2 to 5 m
    assert 0.1 / 5 < found["known"]["measured"]["bearing_sd"] < 0.1 / 2
    assert list(tmp_path.iterdir()) == []
    assert cli.main(["show", "circle[steps=300]", "--seed", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["seen"]["mean"] != found["seen"]["mean"]


def test_a_page_and_an_svg_are_written_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said: list[str] = []
    for kind, flag in (("html", "--quiet"), ("svg", "--json")):
        assert cli.main(["show", "circle[steps=300]", "--out", str(tmp_path / f"x.{kind}"), flag]) == 0
        said.append(capsys.readouterr().out)
    assert said[0] == ""
    assert json.loads(said[1])["way"]["steps"] == 300
    page = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert "<h1>circle[steps=300], seed 0</h1>" in page
    assert "data:image/png;base64," in page
    assert "<dt>stated noise</dt>" in page
    assert 'src="http' not in page
    assert "Where it sees" in (tmp_path / "x.svg").read_text(encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.html", "x.svg"]


def test_a_seed_that_changes_nothing_is_said_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    log_folder.write(tmp_path / "mine", log_of(3), None)
    assert cli.main(["show", "mine", "--seed", "3"]) == 0
    assert "it is the same for every --seed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("t", "words"), [([3.5], "none: there is one step"), ([0.0, 1.0, 2.0], "none: t is the number of the step")]
)
def test_a_log_without_times_says_why(t: list[float], words: str) -> None:
    log = log_of(len(t), (0,), (3,), t=np.array(t))
    assert dict(facts(measured(log, None), ""))["times"] == words


def _not_blank(picture: Path) -> None:
    """There is ink in the title and in each half of it."""
    image = matplotlib.image.imread(picture)[..., :3]
    height, width = image.shape[:2]
    assert min(height, width) > 800
    dark = np.asarray((image < 0.6).any(axis=2))
    for part in (dark[:60], dark[60:, : width // 2], dark[60:, width // 2 :]):
        assert part.mean() > 0.001


def test_a_notebook_shows_it_too(tmp_path: Path) -> None:
    log, truth = slamduel.load("circle[steps=120]")
    portrait = slamduel.show(Dataset(log, truth))
    assert repr(portrait).startswith(f"circle: {len(log)} steps")
    assert "stated noise" in repr(portrait)
    assert portrait.numbers.way.steps == len(log)
    assert portrait._repr_png_().startswith(b"\x89PNG")  # pyright: ignore[reportPrivateUsage]
    portrait.save(tmp_path / "log.svg")
    assert "<svg" in (tmp_path / "log.svg").read_text()
    with pytest.raises(slamduel.SlamduelError, match="there is no dataset"):
        slamduel.show("circel")
    with pytest.raises(slamduel.InputError, match="expected a name, a path, a Log or a Dataset"):
        slamduel.show((log, truth))  # pyright: ignore[reportArgumentType]


def wandering() -> tuple[Dataset, Map, list[int]]:
    """A journey with a true path and no places, the two most seen of its landmarks on the move; and its map."""
    made = made_log(np.random.default_rng(4), around(600))
    log = made.log
    ids, times = np.unique(log.ids, return_counts=True)
    moving = sorted(ids[np.argsort(times)[-2:]].tolist())
    row = np.flatnonzero(np.isin(log.ids, moving))
    z = log.z.copy()
    z[row, 0] += np.random.default_rng(5).uniform(3, 9, len(row))
    return Dataset(replace(log, z=z), Truth(log.t, made.path, None, None, "truth")), made.map, moving


@pytest.mark.parametrize("by", ["truth", "the batch optimum"])
def test_ids_that_are_not_in_one_place_are_named(by: str) -> None:
    dataset, places, moving = wandering()
    dataset = dataset if by == "truth" else Dataset(dataset.log, None)
    drawn = shown(dataset, None)
    assert by in drawn.words
    found = numbers(dataset, drawn, returns(dataset.log))
    scattered = found.known.scattered
    assert scattered.ids == tuple(moving)
    assert scattered.sightings == int(np.isin(dataset.log.ids, moving).sum())
    assert 0.5 < scattered.spread_least <= scattered.spread_most < 9  # by as much they are moved at most
    assert len(drawn.xy) == len(places.ids) - 2
    said = dict(facts(found, drawn.words))["not in one place"]
    assert said.startswith(f"ids {moving[0]} and {moving[1]} ({scattered.sightings} sightings, ")
    assert said.endswith(" m): do they move?")


def test_no_id_is_astray_where_all_stand_or_the_path_is_not_known_or_the_places_are() -> None:
    made = made_log(np.random.default_rng(4), around(600))
    moved, places, _ = wandering()
    for log, truth in ((made.log, moved.truth), (moved.log, None), (moved.log, moved.truth._replace(map=places))):
        found = measured(log, truth)
        assert found.known.scattered is None
        assert "not in one place" not in dict(facts(found, ""))


def test_noise_is_judged_by_median_places_as_by_true_ones() -> None:
    dataset, places, moving = wandering()
    log, truth = dataset
    known = measured(log, truth).known
    stand = ~np.isin(places.ids, moving)
    exact = measured(log, truth._replace(map=Map(places.ids[stand], places.xy[stand], None))).known
    assert known.medians
    assert not exact.medians
    for one in (known, exact):
        assert one.sightings.scale == pytest.approx(1, abs=0.1)
        assert one.measured == pytest.approx(np.sqrt(np.diagonal(log.z_cov[0])), rel=0.1)
    words = dict(facts(measured(log, truth), "truth"))["sightings against truth"]
    assert words.startswith("against each landmark's median place \N{MIDDLE DOT} typical error as stated")
    assert "measured: range " in words
    assert f"range_sd={known.measured.range_sd:.3g}, bearing_sd=" in words  # pyright: ignore[reportOptionalMemberAccess]
    assert judge(log, truth._replace(kind="reference"), None) is None


def test_no_noise_is_advised_for_a_log_with_a_mistake() -> None:
    log, truth = slamduel.load("circle")
    said = str(slamduel.show(Dataset(replace(log, z=log.z * [1, -1]), truth)))
    assert "bearings, or turning rates, are positive to the other side" in said
    assert "no noise is measured: see the remark" in said
    assert "range_sd=" not in said
    assert "range_sd=" in str(slamduel.show(Dataset(log, truth)))


def test_typical_errors_and_far_ones_do_not_contradict_one_another() -> None:
    found = measured(log_of(2))
    for scale, far, words in (
        (0.917, 0.0838, "typical error as stated (0.917 times), but 8.38 % are far out, where chance has 0.1 %"),
        (3.0, 0.5, "stated too small: the typical error is 3.00 times the stated one, and 50.0 % are far out"),
        (0.5, 0.05, "stated too large: the typical error is 0.500 times the stated one, but 5.00 % are far out"),
        (1.0, 0.001, "typical error as stated (1.00 times) \N{MIDDLE DOT} 0.100 % far out, where chance has 0.1 %"),
    ):
        known = found.known._replace(odometry=NoiseCheck(100, 2.44, 2.0, far, scale))
        said = dict(facts(found._replace(known=known), ""))["odometry against truth"]
        assert said.startswith(words)
        assert said.endswith("NEES 2.44, where 1 is exact \N{MIDDLE DOT} 100 checked")


def test_many_misfits_to_the_batch_optimum_ask_what_is_wrong() -> None:
    made = made_log(np.random.default_rng(4), around(200))
    rng = np.random.default_rng(6)
    for share, asked in ((0.15, True), (0.02, False)):
        z = made.log.z.copy()
        row = rng.choice(len(z), int(share * len(z)), replace=False)
        z[row, 0] *= rng.uniform(1.5, 3, len(row))
        words = shown(Dataset(replace(made.log, z=z), None), None).words
        assert "sightings do not fit)" in words
        assert words.endswith(": sign of bearings, unit, clock, or landmarks that move?") == asked


def test_a_picture_marks_what_is_not_in_one_place(tmp_path: Path) -> None:
    portrait = slamduel.show(wandering()[0])
    portrait.save(tmp_path / "log.svg")
    drawn = (tmp_path / "log.svg").read_text()
    assert "not in one place" in drawn
    assert "landmark, median of its sightings" in drawn
    slamduel.show("circle[steps=120]").save(tmp_path / "known.svg")
    known = (tmp_path / "known.svg").read_text()
    assert "not in one place" not in known
    assert "median of its sightings" not in known


def test_arrays_that_do_not_fit_are_refused_in_a_sentence() -> None:
    log = twice_round()
    with pytest.raises(
        slamduel.SlamduelError, match=r"small: sightings row 0: z has shape \(2, 2\), expected \(6, 2\)"
    ):
        slamduel.show(replace(log, z=log.z[:2]))
    truth = Truth(log.t + 0.5, np.zeros((9, 3)), None, None, "truth")
    with pytest.raises(slamduel.SlamduelError, match=r"small: truth: row 0: t is 0\.5"):
        slamduel.show(Dataset(log, truth))
