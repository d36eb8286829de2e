"""The noise of ranges alone, and the scale and offset that they have in common."""

import re
from dataclasses import replace

import numpy as np
import pytest

from beacon_drives import RANGE, Drive, drive
from refusals import refused
from slamduel.bench.noise.measured import Noise, measured
from slamduel.bench.noise.words import rows, sentences
from slamduel.bench.systematic.ranges import of_ranges
from slamduel.bench.systematic.words import sentences as words
from slamduel.core.factors import Dataset, Log, Map, Truth
from slamduel.core.truth.errors import sighted_from
from slamduel.datasets.noise.model import Model, SightingModel
from slamduel.datasets.noise.stated import stated
from slamduel.datasets.noise.systematic import Systematic, corrected

SCALE, OFFSET = 0.06, 0.2


def long(found: Drive, scale: float, offset: float, of: int | None = None) -> Dataset:
    """The drive with ranges, of one beacon or all, that are too long."""
    log = found.log
    assert log.partial is not None
    mine = np.ones(len(log.partial), bool) if of is None else log.partial.ids == of
    z = np.where(mine, (1 + scale) * log.partial.z + offset, log.partial.z)
    z.flags.writeable = False
    truth = Truth(log.t, found.path, Map(np.arange(len(found.beacons)), found.beacons, None))
    return Dataset(replace(log, partial=replace(log.partial, z=z)), truth)


def by_truth(dataset: Dataset) -> Noise:
    return measured([dataset], ["drive"])


def test_scale_and_offset_are_found_along_the_true_path_and_said() -> None:
    found = by_truth(long(drive(1, steps=1000), SCALE, OFFSET))
    assert found.systematic is not None
    assert set(found.systematic.certain) == {"range_scale", "range_offset"}
    for name, true in (("range_scale", SCALE), ("range_offset", OFFSET)):
        one = found.systematic.estimates[name]
        assert one.low < true < one.high
        assert one.high - one.low < 0.2 * true
    said = " ".join(sentences(found))
    assert "Ranges are 6.0" in said
    assert "% too long" in said
    assert "landmark" not in said.split("Range errors")[0]
    assert any(row.name == "ranges: scale, landmark 3" for row in rows(found))
    assert found.range is not None
    assert found.range.fitted.sd.value == pytest.approx(0.05, rel=0.1)
    assert found.range.fitted.correlation is None


@pytest.mark.parametrize("delay", [0.0, 0.3, 3.0])
def test_a_delay_of_ranges_is_found_and_said_and_no_noise(delay: float) -> None:
    """Ranges are moved to later steps; scale, offset and noise are those of ranges in time."""
    log, truth = long(drive(1, steps=1000), SCALE, OFFSET)
    table = log.partial
    assert table is not None
    assert truth is not None
    assert truth.map is not None
    columns = *truth.poses[:, :2].T, np.unwrap(truth.poses[:, 2])
    then = np.stack([np.interp(log.t[table.step] - delay, truth.t, column) for column in columns], axis=-1)
    right, was = (sighted_from(poses, truth.map.xy[table.ids])[:, 0] for poses in (truth.poses[table.step], then))
    z = table.z + (1 + SCALE) * (was - right)
    z.flags.writeable = False
    found = by_truth(Dataset(replace(log, partial=replace(table, z=z)), truth))
    ((noun, late),) = found.late
    assert noun == "ranges"
    assert late.certain == (delay > 0)
    half = (late.delay.high - late.delay.low) / 2
    assert late.delay.value == pytest.approx(delay, abs=2.5 * half)
    said = [one for one in sentences(found) if "Ranges alone are" in one]
    assert len(said) == (delay > 0)
    assert all(" s late" in one and "option sensor_delay=" in one for one in said)
    assert any(row.name == "ranges alone: delay" and row.unit == "s" for row in rows(found))
    assert found.systematic is not None
    for name, true in (("range_scale", SCALE), ("range_offset", OFFSET)):
        one = found.systematic.estimates[name]
        assert one.low < true < one.high
    assert found.range is not None
    assert found.range.fitted.sd.value == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize(
    ("factor", "said"),
    [(1000.0, r"Ranges are (1,0|9)\d\d times too long: millimetres\?"),
     (3.281, r"Ranges are 3\.\d+ times too long: feet\?"),
     (2.5, r"Ranges are 2\.[45]\d times too long\."), (0.25, r"Ranges are (4\.\d\d|3\.9\d) times too short\.")],
)  # fmt: skip
def test_a_manifold_is_said_as_a_factor_and_with_the_unit_that_it_may_be(factor: float, said: str) -> None:
    found = by_truth(long(drive(1, steps=1000), factor - 1, 0.0))
    assert re.search(said, " ".join(sentences(found)))


def test_exact_ranges_are_not_said_to_be_off() -> None:
    for seed in range(2):
        found = by_truth(long(drive(seed, steps=1000), 0.0, 0.0))
        assert found.systematic is not None
        assert found.systematic.certain == []


def test_a_beacon_whose_ranges_are_unlike_the_others_is_named() -> None:
    found = of_ranges([long(drive(2, steps=2000), 0.2, 0.0, of=3)])
    assert found is not None
    names = {k: one["range_scale"].value for k, one in found.each.items()}
    assert names[3] == pytest.approx(0.2, abs=0.02)
    assert max(abs(names[k]) for k in (0, 1, 2)) < 0.02
    assert any("to landmark 3" in sentence for sentence in words(found))


def test_a_few_reflected_ranges_do_not_matter() -> None:
    right, wrong = long(drive(3, steps=1000), SCALE, 0.0), long(drive(3, steps=1000), SCALE, 0.0)
    assert wrong.log.partial is not None
    z = wrong.log.partial.z + 8.0 * (np.arange(1000) % 20 == 7)
    wrong = wrong._replace(log=replace(wrong.log, partial=replace(wrong.log.partial, z=z)))
    one, other = of_ranges([right]), of_ranges([wrong])
    assert one is not None
    assert other is not None
    assert other.errors.range_scale == pytest.approx(one.errors.range_scale, abs=0.005)


def test_without_a_true_path_the_wheels_tell_the_scale() -> None:
    found = measured([Dataset(long(drive(4, steps=1000), SCALE, 0.0).log, None)], ["drive"])
    assert found.systematic is not None
    one = found.systematic.estimates["range_scale"]
    assert one.low < SCALE < one.high
    assert found.systematic.certain == ["range_scale"]
    assert any("wheels" in remark for remark in found.remarks)
    assert found.range is not None
    assert found.range.fitted.sd.value == pytest.approx(0.05, rel=0.15)


def test_a_path_by_gps_tells_of_ranges_and_not_of_motions() -> None:
    dataset = long(drive(5, steps=1000), SCALE, 0.0)
    assert dataset.truth is not None
    found = by_truth(dataset._replace(truth=dataset.truth._replace(words="GPS")))
    assert found.motions is None
    assert found.systematic is not None
    assert found.systematic.certain == ["range_scale"]
    assert "not exact" in found.remarks[0]


def test_too_few_ranges_are_refused() -> None:
    refused("too few ranges alone", measured, [Dataset(drive(6, steps=50).log, None)], ["drive"])


# --- what is stated


def test_a_log_is_corrected_and_its_prior_knows() -> None:
    exact, off = long(drive(7), 0.0, 0.0).log, long(drive(7, scale_sd=0.1), 0.0, 0.0).log
    changed = long(drive(7), SCALE, OFFSET).log
    found = corrected(changed, Systematic(range_scale=SCALE, range_offset=OFFSET))
    assert exact.partial is not None
    assert found.partial is not None
    np.testing.assert_allclose(found.partial.z, exact.partial.z, rtol=1e-12)
    np.testing.assert_allclose(found.partial.var, exact.partial.var / (1 + SCALE) ** 2, rtol=1e-12)
    assert off.prior.systematic.range_scale == 0.1
    assert corrected(off, Systematic(range_scale=0.01)).prior.systematic.range_scale == 0.0
    assert corrected(off, Systematic(range_offset=0.01)).prior.systematic.range_scale == 0.1


def slow(time: float, share: float) -> Model:
    return Model(["drive"], None, SightingModel(2.0, 0.0, 5.0, 0.0, share, time, 0.0), None)


def variances(log: Log) -> np.ndarray:
    assert log.partial is not None
    return log.partial.var


def test_independent_errors_are_stated_as_they_are() -> None:
    log = drive(8).log
    np.testing.assert_allclose(variances(stated(log, slow(1.0, 0.0))), 4 * variances(log), rtol=1e-12)


def test_of_slow_errors_each_has_its_share_of_the_information() -> None:
    """Many of a time tau, at a rate f, have the variance of a mean with sd sqrt(2 tau f) times as large each."""
    log = drive(9, steps=4000).log
    assert log.partial is not None
    one = np.flatnonzero(log.partial.ids == 0)
    log = replace(log, partial=log.partial.rows(one))
    tau = 5.0
    rate = len(one) / (log.t[-1] - log.t[0])
    wanted = 4 * 2 * tau * rate * variances(log)
    np.testing.assert_allclose(variances(stated(log, slow(tau, 1.0))), wanted, rtol=0.1)
    np.testing.assert_allclose(variances(stated(log, slow(tau, 1.0), own=True)), 4 * variances(log), rtol=1e-12)


def test_the_kinds_are_apart() -> None:
    log = drive(10, kinds=(0, 1)).log
    assert log.partial is not None
    found = variances(stated(log, slow(1.0, 0.0)))
    ranges = log.partial.kind == RANGE
    np.testing.assert_allclose(found[ranges], 4 * log.partial.var[ranges], rtol=1e-12)
    np.testing.assert_array_equal(found[~ranges], log.partial.var[~ranges])
