"""Logs with ranges and bearings alone, positions and headings: shown, validated and exported."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slamduel
from gyro_logs import small_gyro_log
from partial_logs import partial_log
from slamduel.bench import cli
from slamduel.bench.logs.facts import facts, headline
from slamduel.bench.logs.part_errors import PartCheck, part_checks
from slamduel.bench.plan.load import load
from slamduel.core.factors import CONSTANTS_NOTE, Dataset, Systematic, Truth
from slamduel.core.truth.errors import named
from slamduel.datasets.remarks import NO_SIGHTING, remarks
from tiers import first_quick


def said(picture: slamduel.LogPicture) -> dict[str, str]:
    return dict(facts(picture.numbers, "path"))


def test_parts_are_counted_among_all_sightings() -> None:
    found = slamduel.show(partial_log(), solve=False)
    numbers = found.numbers
    assert numbers.seen.sightings == 11
    assert numbers.seen.unknown == 3
    assert numbers.seen.most == 4
    assert numbers.seen.steps_without == 1
    assert numbers.landmarks is not None
    assert (numbers.landmarks.landmarks, numbers.landmarks.most) == (4, 3)
    assert numbers.parts is not None
    assert (numbers.parts.ranges, numbers.parts.bearings) == (3, 2)
    assert (numbers.parts.range_least, numbers.parts.range_median, numbers.parts.range_most) == (0.7, 1.5, 2.0)
    assert numbers.fixes is not None
    assert numbers.fixes[:2] == (3, 2)
    assert (numbers.fixes.steps, numbers.fixes.longest_without) == (3, 2)
    assert (
        "11 sightings of 4 landmarks, 3 ranges without a bearing and 2 bearings without a range among them, 3 p"
        in headline(numbers)
    )
    words = said(found)
    assert words["a part alone"].startswith("3 ranges, 0.700 to 2.00 m, median 1.50 m")
    assert "2 bearings" in words["a part alone"]
    assert words["in the world"].startswith("3 positions, stated to")
    assert words["in the world"].endswith("at 3 steps, at most 2 without in a row")


def test_turns_of_a_gyro_are_counted() -> None:
    """Two steps have none, one of them the first of the log; the bias moves once."""
    found = slamduel.show(small_gyro_log(), solve=False)
    turns = found.numbers.turns
    assert turns is not None
    assert (turns.turns, turns.moves, turns.longest_without) == (4, 1, 1)
    assert (turns.bias, turns.bias_sd, turns.moves_sd) == (0.01, 0.1, pytest.approx(1e-3))
    assert ", 4 turns by a gyro, " in headline(found.numbers)
    words = said(found)["turns by a gyro"]
    assert words.startswith("4 turns since the step before, stated to 0")
    assert "bias 0.573 degrees/s at first, with a standard deviation of 5.73" in words
    assert "moving 1 time, by 0.0573 degrees/s in all" in words
    assert words.endswith("at most 1 step without in a row")
    assert "turns by a gyro" not in said(slamduel.show(partial_log(), solve=False))


def test_a_gyros_turns_are_counted_where_a_log_is_validated(capsys: pytest.CaptureFixture[str]) -> None:
    for options, there in (("gyro=0.05", True), ("gps=20", False)):
        assert cli.main(["validate", f"circle[steps=60,{options}]"]) == 0
        assert (", 59 turns by a gyro, " in capsys.readouterr().out) == there


@pytest.mark.parametrize(
    "options", ["ranges_only=1", "bearings_only=1", "ranges_only=1,ids=hidden", "gps=20,compass=5"]
)
def test_a_log_of_parts_alone_is_shown(tmp_path: Path, options: str, capsys: pytest.CaptureFixture[str]) -> None:
    log = f"circle[steps=200,{options}]"
    picture = tmp_path / "log.svg"
    assert cli.main(["show", log, "--out", str(picture)]) == 0
    assert picture.stat().st_size > 10_000
    assert cli.main(["validate", log]) == 0
    out = capsys.readouterr().out
    for part, words in (("ranges", "ranges without a bearing"), ("bearings", "bearings without a range")):
        assert out.count(f", all of them {words}") == 2 * (f"{part}_only=1" in options)  # of show and of validate
    assert ("positions or headings in the world" in out) == ("gps" in options)
    assert NO_SIGHTING not in out
    if "ranges" in options:
        assert "Ranges alone" in picture.read_text()
    elif "bearings" in options:
        assert "Bearings alone" in picture.read_text()


def test_without_truth_it_is_drawn_by_the_batch_optimum() -> None:
    log = slamduel.load("circle[steps=100,ranges_only=1]").log
    found = slamduel.show(log)
    assert "the batch optimum" in repr(found)
    assert "dead reckoning" in repr(slamduel.show(log, solve=False))
    assert "returns not counted without whole sightings" in headline(found.numbers)
    blind = log.without_partial()
    assert NO_SIGHTING in remarks(Dataset(blind, None))
    assert NO_SIGHTING not in remarks(Dataset(log, None))


def test_true_ids_of_parts_are_named() -> None:
    log = partial_log()
    truth = Truth(np.zeros(0), np.zeros((0, 3)), assigned_partial=np.array([3, 12, 12, 8, 7]))
    found = named(log, truth)
    assert found.partial is not None
    assert found.partial.ids.tolist() == [3, 12, 12, 8, 7]
    assert found.ids is log.ids
    assert log.unknown == 3
    assert log.seen.tolist() == [*log.ids.tolist(), 3, 12, 12, -1, 7]


def test_an_export_counts_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = "circle[steps=50,ranges_only=0.5]"
    assert cli.main(["export", parts, "--as", "log,pyfg", "--out", str(tmp_path / "b")]) == 0
    log = slamduel.load(tmp_path / "b" / "log").log
    assert f"{len(log.seen)} sightings" in capsys.readouterr().out
    assert (tmp_path / "b" / "log" / "ranges.csv").exists()
    pyfg = slamduel.load(tmp_path / "b" / "log.pyfg").log
    assert pyfg.partial is not None
    assert log.partial is not None
    np.testing.assert_array_equal(pyfg.partial.z, log.partial.z)


def test_signatures_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    log = "circle[steps=200,signature_sd=0.25]"
    found = slamduel.show(load(log, 1).log, solve=False)
    assert "with signatures, stated to 0.250" in said(found)["sightings"]
    assert "signatures" not in said(slamduel.show(load("circle[steps=200]", 1).log, solve=False))["sightings"]
    assert cli.main(["validate", log]) == 0
    assert "the whole ones with signatures" in capsys.readouterr().out


def ranging(scale: float = 0.0, *, places: bool = True) -> Dataset:
    """A log with ranges alone, all of them longer by a share, with ground truth, perhaps without landmarks' places."""
    log, truth = slamduel.load("circle[steps=400,ranges_only=1]", 3)
    assert truth is not None
    assert log.partial is not None
    longer = replace(log.partial, z=(1 + scale) * log.partial.z)
    return Dataset(replace(log, partial=longer), truth if places else truth._replace(map=None))


@pytest.mark.parametrize("places", [True, False])
def test_the_error_of_ranges_alone_is_told_by_the_truth_with_and_without_places(places: bool) -> None:
    """As many as 400 errors or more have a typical one within 15 %: four standard deviations of a median's."""
    found = slamduel.show(ranging(places=places), solve=False)
    check = found.numbers.known.ranges
    assert check is not None
    assert check.stated.checked >= 400
    assert check.stated.scale == pytest.approx(1, abs=0.15)
    assert check.fitted != places
    assert check.sd == pytest.approx(stated_sd(found), rel=0.15)
    words = said(found)["ranges against truth"]
    assert ("against the places that fit best" in words) != places
    assert "typical error as stated" in words
    assert f"(range_sd={check.sd:.3g})" in words
    assert found.numbers.known.bearings is None


def stated_sd(found: slamduel.LogPicture) -> float:
    """The median of what ranges alone are stated to, m."""
    parts = found.numbers.parts
    assert parts is not None
    assert parts.range_sd is not None
    return parts.range_sd.median


def test_ranges_that_are_too_long_are_not_called_noise() -> None:
    assert "as unknown" not in said(slamduel.show(ranging(), solve=False))["ranges against truth"]
    found = slamduel.show(ranging(0.3), solve=False)
    check = found.numbers.known.ranges
    assert check is not None
    words = said(found)["ranges against truth"]
    assert check.middle > check.spread
    assert "range_sd=" not in words
    assert "m too long, which is no noise, and " in words


def unsure(check: PartCheck) -> float:
    """Four standard deviations of the typical error over what is stated: of a median of n absolute values 1.17 / √n."""
    return 4.7 / np.sqrt(check.stated.checked)


@pytest.mark.parametrize("unknown", ["range_scale=0.1", "range_offset=0.5", "range_scale=0.1,range_offset=0.5"])
@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_a_scale_and_an_offset_that_are_stated_as_unknown_are_no_noise(unknown: str, seed: int) -> None:
    """The true places tell scale and offset to a fortieth and 0.1 m: five standard errors of a line through 200 ranges.

    Without places the noise that is left has a little less: a place of its own for each landmark takes a part.
    """
    log, truth = slamduel.load(f"circle[steps=400,ranges_only=1,{unknown}]", seed)
    assert truth is not None
    drawn = log.notes[CONSTANTS_NOTE]
    check = part_checks(log, truth)[0]
    assert check is not None
    assert check.constant is not None
    assert check.stated.scale == pytest.approx(1 + drawn["range_scale"], abs=unsure(check))  # noise is scaled, too
    assert check.constant.landmarks == 0
    for name, one in (("range_scale", check.constant.range_scale), ("range_offset", check.constant.range_offset)):
        assert (one is None) == (name not in unknown)
        if one is not None:
            assert one == pytest.approx(drawn[name], abs=0.025 if name == "range_scale" else 0.1)
    blind = part_checks(log, truth._replace(map=None))[0]
    assert blind is not None
    assert blind.fitted
    assert blind.stated.scale == pytest.approx(check.stated.scale, abs=unsure(check))
    told = log.prior._replace(systematic=Systematic())
    off = part_checks(replace(log, prior=told), truth)[0]
    assert off is not None
    assert off.constant is None
    assert off.sd > check.sd or max(abs(drawn["range_scale"] * 5), abs(drawn["range_offset"])) < 0.1


def test_each_landmarks_own_scale_is_no_noise_and_the_words_say_so(tmp_path: Path) -> None:
    log, truth = slamduel.load("circle[steps=400,ranges_only=1,range_scale=0.1]", 3)
    assert truth is not None
    assert log.partial is not None
    own = 1 + 0.05 * np.cos(log.partial.ids)
    each = log.prior._replace(systematic=log.prior.systematic._replace(each=True))
    other = Dataset(replace(log, prior=each, partial=replace(log.partial, z=own * log.partial.z)), truth)
    found = slamduel.show(other, solve=False)
    check = found.numbers.known.ranges
    assert check is not None
    assert check.constant is not None
    assert check.constant.landmarks == len(np.unique(log.partial.ids))
    assert check.stated.scale == pytest.approx(1, abs=unsure(check))
    words = said(found)["ranges against truth"]
    assert f"states as unknown, the median of {check.constant.landmarks} landmarks' own" in words
    found.save(tmp_path / "log.svg")
    assert "actual, against truth, without scale and offset" in (tmp_path / "log.svg").read_text()


def test_the_error_of_bearings_alone_is_told_and_without_truth_nothing_is() -> None:
    log, truth = slamduel.load("circle[steps=400,bearings_only=1]", 3)
    found = slamduel.show(Dataset(log, truth), solve=False)
    check = found.numbers.known.bearings
    assert check is not None
    assert check.stated.scale == pytest.approx(1, abs=0.15)
    assert f"(bearing_sd={check.sd:.3g})" in said(found)["bearings against truth"]
    assert not any("against truth" in heading for heading in said(slamduel.show(log, solve=False)))


@pytest.mark.parametrize("kind", ["ranges_only=1", "bearings_only=1"])
def test_a_picture_of_parts_alone_has_when_they_were_heard_and_their_noise(tmp_path: Path, kind: str) -> None:
    picture = tmp_path / "log.svg"
    slamduel.show(slamduel.load(f"circle[steps=200,{kind}]", 1)).save(picture)
    text = picture.read_text()
    for words in ("When each landmark was seen, in part", "landmark, by first sighting", "actual, against truth"):
        assert words in text
    assert ("standard deviation, m" if "ranges" in kind else "standard deviation, degrees") in text
    slamduel.show(slamduel.load(f"circle[steps=200,{kind}]", 1).log).save(picture)
    assert "Its noise, as stated" in picture.read_text()
