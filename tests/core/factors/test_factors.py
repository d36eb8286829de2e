import dataclasses
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refusals import refused
from slamduel.core.beside import KINDS, Clouds, Scans, columns_of, misfit
from slamduel.core.factors import REMARKS, UNKNOWN, Dataset, Log, Map, Prior
from slamduel.core.relations import Anchors
from slamduel.core.se2 import compose
from slamduel.datasets import archive
from small_log import columns, positive_definite, small_log

COLUMNS = [field.name for field in dataclasses.fields(Log) if isinstance(getattr(small_log(), field.name), np.ndarray)]


def test_steps_are_rows_of_the_columns():
    parts = columns(np.random.default_rng(1))
    log = small_log()
    steps = list(log)
    assert len(log) == len(steps) == 6
    assert steps[0].odometry is None
    for k, step in enumerate(steps):
        assert step.t == parts["t"][k]
        if step.odometry is not None:
            np.testing.assert_array_equal(step.odometry.delta, parts["delta"][k])
            np.testing.assert_array_equal(step.odometry.cov, parts["delta_cov"][k])
        seen, loops = parts["sighting_step"] == k, parts["loop_step"] == k
        for found, name in zip(step.sightings, ("ids", "z", "z_cov"), strict=True):
            np.testing.assert_array_equal(found, parts[name][seen])
        for found, name in zip(step.loops, ("loop_to", "loop_delta", "loop_cov"), strict=True):
            np.testing.assert_array_equal(found, parts[name][loops])
    assert [len(step.sightings.ids) for step in steps] == [3, 0, 2, 0, 0, 1]


def test_a_log_indexes_from_both_ends_and_no_further():
    log = small_log()
    assert log[-1].t == log[5].t == log.t[5]
    with pytest.raises(IndexError):
        log[6]


def test_columns_and_steps_are_two_ways_to_the_same_log():
    log = small_log()
    again = Log.from_steps(log.name, log.prior, list(log), log.notes)
    assert again.digest == log.digest
    np.testing.assert_array_equal(again.sighting_step, [0, 0, 0, 2, 2, 5])
    np.testing.assert_array_equal(again.loop_step, [3, 5])


@pytest.mark.parametrize("name", COLUMNS)
def test_columns_cannot_be_written_to(name: str):
    column = getattr(small_log(), name)
    with pytest.raises(ValueError, match="read-only"):
        column[:] = 0


def test_what_steps_and_the_prior_hold_cannot_be_written_to():
    log = small_log()
    assert log.prior.map.cov is not None
    step = log[2]
    for array in (*log.prior[:2], *log.prior.map, *step.odometry, *step.sightings, *step.loops):
        with pytest.raises(ValueError, match="read-only"):
            np.asarray(array)[...] = 0


def test_a_log_is_a_copy_of_what_it_was_made_from():
    parts = columns(np.random.default_rng(1))
    log = Log.from_arrays(**parts)
    before = small_log().digest
    parts["z"][:] = 7.0
    parts["prior"].pose[:] = 7.0
    assert log.digest == before


@given(st.sampled_from(COLUMNS), st.data())
def test_any_flipped_bit_changes_the_digest(name: str, data: st.DataObject):
    log = small_log()
    column = np.array(getattr(log, name))
    bits = column.view(np.uint8).reshape(-1)
    place = data.draw(st.integers(0, 8 * len(bits) - 1))
    bits[place // 8] ^= 1 << place % 8
    assert dataclasses.replace(log, **{name: column}).digest != log.digest


@pytest.mark.parametrize("part", ["pose", "cov", "ids", "xy", "map cov", "no map", "no map cov"])
def test_the_prior_is_part_of_the_digest(part: str):
    def change(parts: dict[str, Any]) -> None:
        pose, cov, known, *_ = parts["prior"]
        match part:
            case "pose":
                pose[2] = np.nextafter(pose[2], 9)
            case "cov":
                cov[0, 0] = np.nextafter(cov[0, 0], 9)
            case "ids":
                known.ids[1] += 1
            case "xy":
                known.xy[1, 1] = np.nextafter(known.xy[1, 1], 9)
            case "map cov":
                known.cov[3, 3] = np.nextafter(known.cov[3, 3], 9)
            case "no map":
                parts["prior"] = Prior(pose, cov)
            case _:
                parts["prior"] = Prior(pose, cov, Map(known.ids, known.xy, None))

    assert small_log(change=change).digest != small_log().digest


def test_the_prior_says_if_there_are_loop_closures() -> None:
    """However the log was made, and whatever the prior that it was made with says."""
    log = small_log()
    assert len(log.loop_to)
    assert not Prior(np.zeros(3), np.eye(3)).loops
    assert log.prior.loops
    assert not log.without_loops().prior.loops
    assert not log.head(3).prior.loops
    assert log.identified().prior.loops
    assert Log.from_steps("again", log.without_loops().prior, list(log)).prior.loops
    assert dataclasses.replace(log).prior.loops
    assert archive.unpacked(archive.packed(Dataset(log, None))).log.prior.loops


def test_names_notes_and_the_unused_first_row_are_not_part_of_the_digest():
    def change(parts: dict[str, Any]) -> None:
        parts |= {"name": "another", "notes": {"licence": "another"}}
        parts["delta"][0] = 99.0
        parts["delta_cov"][0] = 99.0

    assert small_log(change=change).digest == small_log().digest


def test_moving_a_sighting_to_the_next_step_changes_the_digest():
    moved = small_log(change=lambda parts: parts["sighting_step"].__setitem__(2, 1))
    assert moved.digest != small_log().digest


def test_without_loops_leaves_out_the_loop_closures_and_nothing_else():
    log = small_log()
    plain = log.without_loops()
    assert sum(len(step.loops.to) for step in log) > 0 == sum(len(step.loops.to) for step in plain)
    for step, kept in zip(log, plain, strict=True):
        for column, left in zip(step.sightings, kept.sightings, strict=True):
            np.testing.assert_array_equal(column, left)
    assert plain.without_loops() is plain


def test_identified_leaves_out_the_unknown_and_nothing_else():
    log = small_log()
    known = log.identified()
    assert UNKNOWN not in known.ids
    for step, kept in zip(log, known, strict=True):
        named = step.sightings.ids != UNKNOWN
        for column, left in zip(step.sightings, kept.sightings, strict=True):
            np.testing.assert_array_equal(column[named], left)
        assert step.t == kept.t
    assert known.identified() is known


@pytest.mark.parametrize("steps", [1, 3, 6])
def test_head_is_the_first_steps(steps: int):
    log = small_log()
    head = log.head(steps)
    assert len(head) == steps
    assert head.digest == Log.from_steps(log.name, log.prior, list(log)[:steps]).digest
    assert (head.digest == log.digest) == (steps == 6)


def test_head_keeps_what_was_seen_up_to_the_next_step_where_it_lies() -> None:
    """Along the head's path the scans and clouds are where they were; after its last step they are seen from there."""
    rng = np.random.default_rng(4)
    step = np.array([0, 1, 1, 3, 5])
    since, until = rng.normal(size=(2, 5, 3))
    at = Anchors(step, since, np.where(step[:, None] == 5, since, until), rng.uniform(size=5))
    scans = Scans(at, np.arange(10, dtype=np.float32).reshape(5, 2), np.zeros(2), np.zeros(3))
    points = rng.integers(-9, 9, (8, 3)).astype(np.int16)
    clouds = Clouds(at, np.array([0, 2, 2, 5, 7, 8]), points, points.astype(np.uint8), np.zeros(3))
    log = dataclasses.replace(small_log(), scans=scans, clouds=clouds)
    whole = log.head(6)
    for kind in KINDS:
        assert misfit(kind, columns_of(kind, getattr(whole, kind)), 6) == ""
        for name, column in columns_of(kind, getattr(log, kind)).items():
            np.testing.assert_array_equal(columns_of(kind, getattr(whole, kind))[name], column)
    head, path = log.head(2), rng.normal(size=(6, 3))
    np.testing.assert_array_equal(head.scans.ranges, scans.ranges[:3])
    assert [head.clouds.xyz(k).tolist() for k in range(3)] == [clouds.xyz(k).tolist() for k in range(3)]
    np.testing.assert_array_equal(head.clouds.colours, clouds.colours[:5])
    placed = head.scans.at.along(path[:2])
    np.testing.assert_allclose(placed[0], at.along(path)[0])
    np.testing.assert_allclose(placed[1:], compose(path[1], since[1:3]))
    one = dataclasses.replace(log, scans=scans.taken(step > 0), clouds=None).head(1)
    assert one.scans is None
    assert one.clouds is None


def test_a_log_needs_neither_sightings_nor_loops():
    prior = Prior(np.zeros(3), positive_definite(np.random.default_rng(3), 1, 3)[0])
    none = np.zeros(0, np.int64)
    one = np.zeros(1), np.zeros((1, 3)), np.eye(3)[None]
    log = Log.from_arrays("bare", prior, *one, none, none, np.zeros((0, 2)), np.zeros((0, 2, 2)))
    (step,) = log
    assert step.odometry is None
    assert step.sightings.z.shape == (0, 2)
    assert step.loops.cov.shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"ids": [3, 3, 3, 3, 8.5, 12]}, "ids: row 4 is 8.5, expected a whole number"),
        ({"ids": ["a"] * 6}, "ids: found list, expected an array of numbers"),
        ({"z": [[1.0], [1.0, 2.0]]}, "z: found list, expected an array of numbers"),
        ({"sighting_step": [0, 0, 2, 0, 2, 5]}, "sighting_step: row 3 is 0 after 2, expected them sorted"),
        ({"prior": [0, 0, 0]}, r"prior: found list, expected Prior\(pose, cov\)"),
    ],
)
def test_arrays_that_are_none_are_named(change: dict[str, Any], sentence: str) -> None:
    parts = columns(np.random.default_rng(1)) | change
    refused(sentence, Log.from_arrays, **parts)


def test_lists_do_as_well() -> None:
    parts = columns(np.random.default_rng(1))
    lists = {name: part.tolist() if isinstance(part, np.ndarray) else part for name, part in parts.items()}
    assert Log.from_arrays(**lists).digest == Log.from_arrays(**parts).digest


@pytest.mark.parametrize("unit", ["s", "ms", "ns"])
def test_times_of_numpy_and_pandas_are_seconds(unit: str) -> None:
    parts: dict[str, Any] = columns(np.random.default_rng(1))
    since = 2000 * np.arange(6) * np.timedelta64(1, "ms")
    for t, start in ((since.astype(f"timedelta64[{unit}]"), 0.0), (np.datetime64("1970-01-02", unit) + since, 86400.0)):
        parts["t"] = t
        np.testing.assert_array_equal(Log.from_arrays(**parts).t, start + 2.0 * np.arange(6))


def test_complex_numbers_and_times_in_place_of_numbers_are_refused() -> None:
    parts: dict[str, Any] = columns(np.random.default_rng(1))
    for name, kind in (("z", "complex128"), ("delta", "timedelta64[s]"), ("t", "complex128")):
        wrong: dict[str, Any] = {**parts, name: parts[name].astype(kind)}
        refused(f"{name}: found ndarray, expected an array of numbers.*{re.escape(kind)}", Log.from_arrays, **wrong)


def test_remarks_are_the_texts_among_the_notes() -> None:
    parts: dict[str, Any] = columns(np.random.default_rng(1))
    for notes, expected in (({}, []), ({REMARKS: ["odd", 3]}, ["odd"]), ({REMARKS: "odd"}, [])):
        parts["notes"] = notes
        assert Log.from_arrays(**parts).remarks == expected
