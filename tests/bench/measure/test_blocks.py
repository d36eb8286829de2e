"""What is computed of a log block by block is the same to the last bit in blocks of any size."""

import pytest

from slamduel.bench.contradiction.two_places import TwoPlaces, two_places
from slamduel.bench.measure.landmark_places import placed
from slamduel.bench.measure.stated_noise import squares_in
from slamduel.bench.plan.load import load
from slamduel.core import arrays
from slamduel.core.factors import Dataset
from slamduel.core.truth.errors import rows_of, sighting_errors
from slamduel.datasets.remarks import remarks


def computed(dataset: Dataset) -> tuple[list[bytes], list[TwoPlaces], list[str]]:
    log, truth = dataset
    assert truth is not None
    row = rows_of(truth.t, log.t)
    places, errors = placed(log, truth.poses, row, known=True), sighting_errors(log, truth)
    columns = (*places, *errors, squares_in(errors, log.z_cov))
    return [column.tobytes() for column in columns], two_places(log, truth.poses[row], places), remarks(dataset)


@pytest.mark.parametrize("name", ["city[steps=400,clutter=0.3,wrong_ids=0.02]", "patrol[steps=500,people=2]"])
def test_blocks_change_no_bit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = load(name)
    whole = computed(dataset)
    monkeypatch.setattr(arrays, "BLOCK", 97)
    assert computed(dataset) == whole
    assert load(name).log.digest == dataset.log.digest
