"""Remarks: none on logs as they are published, drawn or studied, and some on logs whose units do not agree."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recorded
from refusals import refused
from slamduel.bench.contradiction.remark import remarks as all_remarks
from slamduel.bench.plan.load import load, made
from slamduel.bench.study import file as study_file
from slamduel.core.factors import REMARKS, Dataset, Log, Map
from slamduel.core.partial import NO_IDS
from slamduel.datasets import archive
from slamduel.datasets.formats import log_folder
from slamduel.datasets.published import catalogue
from slamduel.datasets.remarks import NO_SIGHTING, refuse, remarks
from slamduel.frontend.pauses import PAUSE, longest_pause
from small_log import small_dataset

CONTRADICTIONS = (
    "the measurements contradict one another: (at the optimum|J falls)|do not fit the others, (as )?where|"
    "not where (its|their) sightings|known places ranges are"
)

DRAWN = ("aruco-robot", "bailey", "circle", "city", "linear", "matlab-report", "victoria-park")

MRCLAM = "mrclam/MRCLAM_Dataset6"
PUBLISHED = {"freiburg": "freiburg", **{f"mrclam[robot={k},": MRCLAM for k in range(1, 6)}}


def at_hand(name: str) -> bool:
    """Tells if a log can be made: a recording has to be on this machine."""
    return name not in catalogue.PUBLISHED or catalogue.place(name).is_dir()


@pytest.mark.parametrize("name", DRAWN)
def test_a_log_as_it_comes_has_no_remark(name: str) -> None:
    assert all_remarks(load(name)) == []


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_log_has_no_remark(name: str) -> None:
    path = recorded.at_hand(PUBLISHED[name])
    assert all_remarks(load(f"{name}path={path}]" if "[" in name else f"{name}[path={path}]")) == []


def test_two_ids_that_were_annotated_wrongly_in_a_published_log_are_named() -> None:
    """From step 3208 on, circle 21 of DLR's log is where 22 was before, to a centimetre, and 22 is the next one."""
    said = all_remarks(load(f"dlr[path={recorded.at_hand('dlr/map.circles')}]"))
    assert [one.split(" m apart")[0] for one in said] == [
        "id 21 is sighted at two places, 0.970",
        "id 22 is sighted at two places, 1.63",
    ]


def known(seen: list[int], ids: list[int], xy: list[tuple[float, float]]) -> list[str]:
    """The remarks on sightings of the ids `seen`, from 2 m, with places of `ids` in landmarks.csv."""
    log, truth = small_dataset()
    z = np.tile([2.0, 0.1], (len(seen), 1))
    step = np.arange(len(seen)) % len(log)
    order = np.argsort(step, kind="stable")
    changed = Log.from_arrays(
        "small", log.prior, log.t, log.delta, log.delta_cov, step[order], np.array(seen)[order], z,
        np.tile(np.diag([0.01, 0.01]), (len(seen), 1, 1)),
    )  # fmt: skip
    assert truth is not None
    places = truth._replace(map=Map(np.array(ids), np.array(xy, float), None), assigned=None, moving=None)
    return [said for said in remarks(Dataset(changed, places)) if "landmarks.csv" in said]


CORNERS = [(0.0, 0.0), (1.2, 0.0), (1.2, 1.2), (0.0, 1.2), (0.6, 0.6)]


def test_ids_without_a_place_are_counted_and_named_with_places_that_are_never_sighted() -> None:
    assert known([1, 2, 3, 4, 5] * 2, [1, 2, 3, 4, 5], CORNERS) == []
    (said,) = known([1, 2, 3, 6, 7, 7], [1, 2, 3, 4, 5], CORNERS)
    assert said == (
        "2 of the 5 ids that are sighted have no known place (landmarks.csv), 6, 7, with 3 of 6 sightings; 2 of those "
        "with a place are never sighted, 4, 5"
    )


def test_places_that_are_never_sighted_are_no_remark_alone() -> None:
    assert known([1, 2, 3], [1, 2, 3, 4, 5], CORNERS) == []


def test_a_place_that_no_sighting_can_join_with_the_others_is_named() -> None:
    (said,) = known([1, 2, 3, 4], [1, 2, 3, 4, 5], [*CORNERS[:4], (18.0, 1.0)])
    assert said.startswith("the known place of landmark 5 (landmarks.csv) is 16.8 m from all others, which are within")


WRONG = {"misstated-noise", "moving-landmarks", "outliers", "false-loops", "rgbdslam2014", "slip", "range-only"}
"""Studies of logs that contradict themselves: noise, landmarks, ids, loops, slip, a scale of ranges."""

MOST_STEPS = 100_000

PARTIAL = {"intel-lab", "fr079"}
"""Laser logs whose copies at hand lack scans that relations are about, or the odometry."""


@pytest.mark.slow
@pytest.mark.parametrize("name", study_file.packaged())
def test_no_log_of_a_packaged_study_has_a_remark(name: str) -> None:
    """Two seeds of every dataset, but that the raw park has no ids, and visual odometry alone nothing to estimate from.

    Both are studied for that. Copies of laser logs are partial. What is rendered or scanned is that of the quick size,
    and logs of a million steps are as those of a tenth of it.
    """
    seen: dict[str, set[int]] = {}
    quick, full = ([planned.cell for planned in study_file.read(name, full=full).cells] for full in (False, True))
    for cell in [*quick, *(cell for cell in full if not cell.dataset.source.costly)]:
        dataset, seed = cell.dataset, cell.seed if cell.dataset.source.draws(cell.dataset.options) else 0
        of = seen.setdefault(dataset.label, set())
        if getattr(dataset.options, "steps", 0) > MOST_STEPS:
            continue
        if seed in of or len(of) == 2 or not at_hand(dataset.name) or dataset.name in PARTIAL:
            continue
        of.add(seed)
        odd = all_remarks(made(dataset, seed))
        odd = [one for one in odd if not (name in WRONG and re.search(CONTRADICTIONS, one))]
        if dataset.name == "victoria-park-raw":
            (without_ids,) = odd
            assert "have no id: " in without_ids
        elif getattr(dataset.options, "odometry", "") == "visual" and not dataset.options.loops:
            assert odd == [NO_SIGHTING]
        elif getattr(dataset.options, "ranges_only", 0.0) == 1 and dataset.options.ids == "hidden":
            assert [one for one in odd if NO_IDS not in one] == []  # what wheels and positions tell alone
        else:
            assert odd == [], f"{dataset.label}, seed {seed}"
    assert seen


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("delta", [100.0, 100.0, 1.0], "the odometry goes .* times as far as their ranges allow"),
        ("z", [100.0, 1.0], "its range changes by .* times the way of the odometry"),
    ],
)
def test_odometry_and_ranges_in_different_units_are_noticed(column: str, factor: list[float], words: str) -> None:
    log, _ = load("circle")
    odd: Any = {column: getattr(log, column) * np.array(factor)}
    (remark,) = remarks(Dataset(replace(log, **odd), None))
    assert re.search(words, remark)


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("z", 100.0, "perhaps the ranges are in centimetres"),
        ("z", 39.4, "perhaps the ranges are in inches or centimetres, or a frame rate, a clock or a speed is wrong"),
        ("z", 24.0, "perhaps a frame rate, a clock or a speed is wrong, or the ranges are in feet"),
        ("delta", 1e3, "perhaps it is in millimetres or centimetres, or the ranges in kilometres"),
        ("delta", 120.0, "perhaps a frame rate, a clock or a speed is wrong, or it is in centimetres or inches"),
    ],
)
def test_a_factor_between_ways_and_ranges_names_what_has_it(column: str, factor: float, words: str) -> None:
    log, _ = load("circle")
    scale = [factor, 1.0] if column == "z" else [factor, factor, 1.0]
    odd: Any = {column: getattr(log, column) * np.array(scale)}
    (told,) = remarks(Dataset(replace(log, **odd), None))
    assert told.endswith(words)


def test_a_time_between_steps_in_which_something_was_read_is_no_gap() -> None:
    log, _ = load("circle")
    t = log.t + 500.0 * (np.arange(len(log)) > 100)
    for notes, told in (({}, 1), ({PAUSE: 500.0}, 1), ({PAUSE: 0.2}, 0), ({PAUSE: "long"}, 1)):
        odd = replace(log, t=t, notes={**log.notes, **notes})
        found = remarks(Dataset(odd, None))
        assert len([one for one in found if "gap in time" in one]) == told
        assert len(found) == told


def test_a_long_motion_in_a_long_time_is_no_jump() -> None:
    log, _ = load("circle")
    delta = log.delta.copy()
    delta[100] *= [60.0, 60.0, 1.0]
    late = log.t + 60.0 * np.diff(log.t).mean() * (np.arange(len(log)) >= 100)
    jumps = remarks(Dataset(replace(log, delta=delta), None))
    assert jumps
    assert all("1 jump of the odometry's d" in told for told in jumps)
    assert remarks(Dataset(replace(log, delta=delta, t=late, notes={**log.notes, PAUSE: 1.0}), None)) == []


@pytest.mark.parametrize("turn", [0.1, -0.1, 0.0])
def test_a_shorter_last_step_at_a_constant_speed_is_no_jump(turn: float) -> None:
    """Without noise, any other motion is beyond all standard deviations; one that goes back or farther is a jump."""
    log, _ = load("circle")
    share = np.where(np.arange(len(log)) == len(log) - 1, 0.4, 1.0)
    delta = np.column_stack((share * 0.5, share**2 * 0.025 * np.sign(turn), share * turn))
    late = log.t - 0.6 * np.diff(log.t).mean() * (share < 1)
    even = replace(log, delta=delta, t=late)
    assert not [one for one in remarks(Dataset(even, None)) if "jump" in one]
    for column, odd, name in ((0, -0.2, "dx"), (0, 1.5, "dx"), (1, 0.4, "dy"), (2, 0.7, "dtheta")):
        jumped = delta.copy()
        jumped[60, column] = odd
        (told,) = (one for one in remarks(Dataset(replace(even, delta=jumped), None)) if "jump" in one)
        assert f"1 jump of the odometry's {name}: " in told


@pytest.mark.parametrize("jitter", [0.0, 1e-4])
def test_the_motions_of_a_robot_that_mostly_stands_are_no_jumps(jitter: float) -> None:
    """It goes straight but for one curve; a jump among its motions is one, and so is one while it stands."""
    log, _ = load("circle[steps=1000]")
    delta = np.random.default_rng(0).normal(0, 1, log.delta.shape) * jitter
    delta[100:140], delta[120:123] = [0.1, 0.0, 0.0], [0.1, 0.02, 0.4]
    quiet = replace(log, delta=delta)
    assert not [one for one in remarks(Dataset(quiet, None)) if "jump" in one]
    for step in (110, 500):
        odd = delta.copy()
        odd[step] = [9.0, 0.0, 0.0]
        (told,) = (one for one in remarks(Dataset(replace(quiet, delta=odd), None)) if "jump" in one)
        assert told.endswith(f"the first of 9 m at step {step}")


def test_a_curve_while_the_camera_pauses_is_no_jump_aside() -> None:
    log, _ = load("circle")
    rate, radius, pause = 0.05, 5.0, 20
    turn = np.where(np.arange(len(log)) == 100, pause, np.random.default_rng(0).uniform(0.8, 1.2, len(log))) * rate
    delta = np.column_stack((radius * np.sin(turn), radius * (1 - np.cos(turn)), turn))
    late = log.t + (pause - 1) * np.diff(log.t).mean() * (np.arange(len(log)) >= 100)
    notes = {**log.notes, PAUSE: 1.0}
    curved = replace(log, delta=delta, t=late, notes=notes)
    assert not [one for one in remarks(Dataset(curved, None)) if "jump" in one]
    at_once = replace(log, delta=delta, notes=notes)
    assert [one for one in remarks(Dataset(at_once, None)) if "jump of the odometry's dy" in one]


def test_the_longest_pause_is_that_of_all_sensors_together() -> None:
    assert longest_pause(1.0, 5.0, [0.0, 2.0, 4.5], np.array([2.5, 3.0, 9.0])) == {PAUSE: 1.5}
    assert longest_pause(1.0, 5.0, (), np.array([-np.inf, np.inf])) == {PAUSE: 4.0}


@pytest.mark.parametrize(("sd", "told"), [(0.9, 0), (1.1, 1), (1000.0, 1)])
def test_a_start_whose_heading_is_unknown_is_noticed(sd: float, told: int) -> None:
    log, _ = load("circle")
    odd = replace(log, prior=log.prior._replace(cov=np.diag([1.0, 1.0, sd**2])))
    found = remarks(Dataset(odd, None))
    assert len(found) == told
    assert all(f"the heading of the prior has a standard deviation of {sd:.3g} rad" in one for one in found)


@pytest.mark.parametrize(
    ("range_", "sd", "turn", "words"),
    [
        (0.003, 0.005, 0.02, "1 sighting of .* from within 3 standard deviations .* at 0.003 m, stated to 0.005 m,"),
        (0.003, 0.005, 1.5, ""),  # as noise in x and y has it
        (0.2, 0.005, 0.02, ""),
    ],
)
def test_a_bearing_from_right_above_a_landmark_is_noticed(range_: float, sd: float, turn: float, words: str) -> None:
    log, _ = load("circle")
    z, cov = log.z.copy(), log.z_cov.copy()
    z[100, 0], cov[100] = range_, np.diag([sd, turn]) ** 2
    found = [one for one in remarks(Dataset(replace(log, z=z, z_cov=cov), None)) if "sighting of" in one]
    assert len(found) == bool(words)
    assert not words or re.match(words, found[0])


def test_a_readers_remark_goes_wherever_the_log_goes(tmp_path: Path) -> None:
    log, truth = small_dataset()
    told = replace(log, notes={**log.notes, REMARKS: ["readings are missing", "so are frames"]})
    assert told.digest == log.digest
    log_folder.write(tmp_path / "log", told, truth)
    archive.save(tmp_path / "log.npz", Dataset(told, truth))
    for again in (log_folder.read(tmp_path / "log"), archive.load(tmp_path / "log.npz")):
        assert remarks(again)[:2] == ["readings are missing", "so are frames"]


def test_strict_refuses_with_the_first_of_them() -> None:
    refuse("drive", [])
    refused(r"--strict: drive: hole; and 1 more\.", refuse, "drive", ["hole", "so are frames"])
