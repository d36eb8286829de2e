"""`bench export`: files that other programs read, all of them or none."""

from pathlib import Path

import numpy as np
import pytest

from command import refused
from slamduel.bench.cli import main
from slamduel.core.factors import UNKNOWN, Dataset, Log
from slamduel.core.truth.tum import read_tum
from slamduel.datasets.formats import g2o, log_folder
from small_log import assert_same, small_dataset, small_log


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A log on disk, without a map in its prior, beside which to export."""
    log, truth = small_dataset()
    plain = small_log(1, lambda parts: parts.update(prior=parts["prior"]._replace(map=None)))
    log_folder.write(tmp_path / "log", plain, truth)
    assert log.digest != plain.digest
    return tmp_path


def test_every_format_is_the_log(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = log_folder.read(place / "log")
    assert main(["export", str(place / "log"), "--out", str(place / "out")]) == 0
    assert sorted(file.name for file in (place / "out").iterdir()) == ["log", "log.g2o", "odometry.tum", "truth.tum"]
    assert_same(log_folder.read(place / "out" / "log"), given)
    assert sorted(g2o.read(place / "out" / "log.g2o").log.ids) == sorted(given.log.ids[given.log.ids != UNKNOWN])
    t, poses = read_tum(place / "out" / "truth.tum")
    np.testing.assert_array_equal(t, given.truth.t)
    np.testing.assert_array_equal(poses, given.truth.poses)
    t, poses = read_tum(place / "out" / "odometry.tum")
    np.testing.assert_array_equal(t, given.log.t)
    np.testing.assert_array_equal(poses, given.log.dead_reckoned())
    said = capsys.readouterr().out
    assert "log.g2o: 6 poses, 2 loop closures, 4 sightings; 2 of unknown landmarks are left out" in said
    assert "truth.tum: 5 poses" in said


def test_only_what_is_asked_for_is_written(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "out").mkdir()  # an empty folder is as good as none
    words = ["--as", "gtsam, tum", "--out", str(place / "out"), "--seed", "2", "--quiet"]
    assert main(["export", "circle[steps=30]", *words]) == 0
    assert sorted(f.name for f in (place / "out").iterdir()) == ["log-gtsam.g2o", "odometry.tum", "truth.tum"]
    assert capsys.readouterr().out == ""
    tags = {line.split()[0] for line in (place / "out" / "log-gtsam.g2o").read_text().splitlines()}
    assert tags == {"VERTEX_SE2", "VERTEX_XY", "EDGE_SE2", "BR"}


def test_a_log_without_truth_has_no_path_of_it(place: Path) -> None:
    log_folder.write(place / "blind", log_folder.read(place / "log").log, None)
    assert main(["export", str(place / "blind"), "--as", "tum", "--out", str(place / "out"), "--quiet"]) == 0
    assert [file.name for file in (place / "out").iterdir()] == ["odometry.tum"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--out out --as g2o,pdf", "--as: found 'pdf', expected one of g2o, gtsam, jrl, pyfg, tum, log."),
        ("--out out --as g2o,g2o", "--as g2o,g2o: a format is named twice, expected once."),
        ("--out out --as gtsam", "range and bearing of sighting 0 are correlated"),
        ("--out log", "log: exists and is not an empty folder, expected a new one."),
        ("--out log/log.toml", "log.toml: exists and is not an empty folder, expected a new one."),
        ("--out log/log.toml/x", "cannot be written"),
    ],
)
def test_a_mistake_is_a_sentence_and_leaves_nothing(
    place: Path, words: str, sentence: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    assert sentence in refused(capsys, "export", "./log", *words.split())
    assert sorted(place.rglob("*")) == before


def test_what_is_exported_for_g2o_runs_by_its_path(place: Path) -> None:
    from slamduel.bench.plan.spec import dataset_variants

    assert main(["export", str(place / "log"), "--as", "g2o", "--out", str(place / "out"), "--quiet"]) == 0
    (variant,) = dataset_variants(str(place / "out" / "log.g2o"))
    found: Dataset = variant.source.make(variant.options, np.random.default_rng(0))
    log: Log = found.log
    assert len(log) == 6
