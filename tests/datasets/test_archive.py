import os
from pathlib import Path

import numpy as np
import pytest

from fuzzing import survivors
from refusals import refused
from slamduel.core.factors import Dataset, Log, Prior, Truth
from slamduel.datasets import archive
from small_log import assert_same, columns, small_dataset

bare_truth = Truth(np.zeros(0), np.zeros((0, 3)), None, None, "reference")


def without_map() -> Log:
    parts = columns(np.random.default_rng(9))
    parts["prior"] = Prior(*parts["prior"][:2])
    return Log.from_arrays(**parts)


@pytest.mark.parametrize(
    "dataset",
    [small_dataset(), Dataset(small_dataset().log, None), Dataset(without_map(), bare_truth)],
    ids=["everything", "no truth", "little"],
)
def test_what_is_saved_is_loaded_bit_for_bit(tmp_path: Path, dataset: Dataset):
    archive.save(tmp_path / "a.npz", dataset)
    assert_same(archive.load(tmp_path / "a.npz"), dataset)
    assert archive.load_log(tmp_path / "a.npz").digest == dataset.log.digest
    assert os.listdir(tmp_path) == ["a.npz"]


def test_what_is_loaded_cannot_be_written_to(tmp_path: Path):
    archive.save(tmp_path / "a.npz", small_dataset())
    log, truth = archive.load(tmp_path / "a.npz")
    for array in (log.t, log.delta, log.z_cov, log.loop_to, log.prior.pose, truth.poses, truth.assigned, truth.map.xy):
        with pytest.raises(ValueError, match="read-only"):
            np.asarray(array)[...] = 0


def test_a_worker_never_reads_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    archive.save(tmp_path / "a.npz", small_dataset())
    asked = list[str]()
    original = np.lib.npyio.NpzFile.__getitem__

    def spy(self: np.lib.npyio.NpzFile, key: str):
        asked.append(key)
        return original(self, key)

    monkeypatch.setattr(np.lib.npyio.NpzFile, "__getitem__", spy)
    archive.load_log(tmp_path / "a.npz")
    assert asked
    assert not [key for key in asked if key.startswith("truth")]


def test_a_missing_archive_is_named(tmp_path: Path):
    refused("there is no such file", archive.load, tmp_path / "a.npz")


def test_a_damaged_archive_is_an_input_error_or_still_the_same(tmp_path: Path):
    archive.save(tmp_path / "a.npz", small_dataset())
    survivors(archive.load, tmp_path / "a.npz", 300, 0, lambda found: assert_same(found, small_dataset()))


def test_a_member_lost_from_the_directory_is_noticed(tmp_path: Path):
    archive.save(tmp_path / "a.npz", small_dataset())
    content = (tmp_path / "a.npz").read_bytes()
    head, _, tail = content.rpartition(b"truth.map.ids")
    (tmp_path / "a.npz").write_bytes(head + b"truth.map.idz" + tail)
    refused(r"a\.npz: not a prepared log", archive.load, tmp_path / "a.npz")


def test_a_failed_save_leaves_the_old_archive_and_nothing_else(tmp_path: Path):
    path = tmp_path / "a.npz"
    archive.save(path, small_dataset())
    bad = small_dataset(seed=5)
    bad.log.notes["odd"] = object()  # pyright: ignore[reportIndexIssue]
    with pytest.raises(TypeError):
        archive.save(path, bad)
    with pytest.raises(ValueError, match="Object arrays"):
        archive.save(path, Dataset(small_dataset().log, bare_truth._replace(poses=object())))  # pyright: ignore[reportArgumentType]
    assert_same(archive.load(path), small_dataset())
    assert os.listdir(tmp_path) == ["a.npz"]
