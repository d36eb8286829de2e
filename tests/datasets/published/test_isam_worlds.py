"""Manhattan, City10000 and CityTrees10000: read as iSAM means them, with a truth that the factors agree with."""

import gzip
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import toy_log
from chi2_at_truth import squared
from fuzzing import survivors
from recorded import at_hand
from refusals import refused_at
from slamduel.bench.cli import main
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.core.truth.check import check_truth
from slamduel.datasets.published.catalogue import PUBLISHED, place
from slamduel.datasets.published.isam_worlds import read
from toy_log import Serve, zipped

serve = pytest.fixture(toy_log.serve)

FILES = {"manhattan": "manhattanOlson3500", "city10000": "city10000", "city-trees10000": "cityTrees10000"}

STEPS = ((1, 0, 0), (1, 0, 1.5708), (1, 0, 0), (1, 0, 3.14159), (-1, -0, 0), (0, 1, -1.5708))
"""True motions with the digits of the files."""


def text(rows: Sequence[tuple[object, ...]]) -> str:
    return "".join(" ".join(map(str, row)) + "\n" for row in rows)


def written(folder: Path, sightings: int = 0) -> Path:
    """A small graph, its measurements 0.01 off in x, and its truth."""
    right = [("EDGE2", k, k + 1, *step, 50, 0, 0, 50, 0, 100) for k, step in enumerate(STEPS)]
    right += [("EDGE2", 0, 3, 2, 1, 1.5708, 50, 0, 0, 50, 0, 100)] * (not sightings)
    right += [("LANDMARK", 0, 4, 2.5, 1.5, 10, 2, 10)] * sightings
    file = folder / "small.txt"
    file.write_text(text([(*row[:3], float(str(row[3])) + 0.01, *row[4:]) for row in right]))
    (folder / "small_groundtruth.txt").write_text(text(right))
    return file


def test_the_truth_is_on_the_grid_and_numbers_are_roots_of_information(tmp_path: Path) -> None:
    log, truth = read(written(tmp_path), "manhattan")
    assert list(problems(log)) == []
    assert truth is not None
    check_truth(log, truth, "log")
    half = np.pi / 2
    path = [[0, 0, 0], [1, 0, 0], [2, 0, half], [2, 1, half], [2, 2, -half], [2, 3, -half], [3, 3, np.pi]]
    np.testing.assert_array_equal(truth.poses, path)
    stated = np.diag([1 / 50**2, 1 / 50**2, 1 / 100**2])
    np.testing.assert_allclose(log.delta_cov[1:], np.broadcast_to(stated, (6, 3, 3)), rtol=1e-12, atol=1e-18)
    assert (len(log.loop_to), log.loop_to[0], log.loop_step[0]) == (1, 0, 3)


def test_a_tree_has_the_inverse_of_its_information_along_the_body(tmp_path: Path) -> None:
    log, truth = read(written(tmp_path, sightings=1), "city-trees10000")
    assert truth is not None
    assert truth.map is not None
    assert truth.map.xy.tolist() == [[2.5, 1.5]]
    r, (x, y) = math.hypot(2.51, 1.5), (2.51, 1.5)
    jacobian = np.array([[x / r, y / r], [-y / r**2, x / r**2]])
    root = np.array([[10.0, 2.0], [0.0, 10.0]])
    np.testing.assert_allclose(log.z_cov[0], jacobian @ np.linalg.inv(root.T @ root) @ jacobian.T, rtol=1e-9)
    np.testing.assert_allclose(log.z[0], [r, math.atan2(y, x)], rtol=1e-12)


def test_a_truth_that_is_missing_or_of_another_graph_is_refused(tmp_path: Path) -> None:
    file, truth = written(tmp_path), tmp_path / "small_groundtruth.txt"
    rows = truth.read_text().splitlines(keepends=True)
    truth.write_text("".join([*rows[:2], *rows[3:]]))
    refused_at(truth, "found 6 rows of small.txt's 7", read, file, "manhattan")
    truth.write_text("".join(rows).replace("EDGE2 0 3", "EDGE2 0 4"))
    refused_at(truth, "line 7: expected that of 0 and 3", read, file, "manhattan")
    truth.unlink()
    refused_at(file, "found no small_groundtruth.txt beside it", read, file, "manhattan")


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    file = written(tmp_path)
    for broken in (file, tmp_path / "small_groundtruth.txt"):
        found, refused = survivors(lambda _: read(file, "manhattan"), broken, 300, 3)
        assert len(found) > 5
        assert len(refused) > 50


def real(name: str) -> Dataset:
    return load(f'{name}[path="{at_hand("posegraphs")}/{FILES[name]}.txt.gz"]')


@pytest.mark.parametrize(
    ("name", "sizes", "chi2"),
    [
        ("manhattan", (3500, 2099, 0), 1.0281),
        ("city10000", (10000, 10688, 0), 0.9955),
        ("city-trees10000", (10000, 0, 4443), 0.9944),
    ],
)
def test_errors_at_the_truth_are_as_stated(name: str, sizes: tuple[int, ...], chi2: float) -> None:
    """Were the numbers information, and not its root, chi2 would be 45 to 100 times less."""
    log, truth = dataset = real(name)
    assert truth is not None
    check_truth(log, truth, name)
    assert (len(log), len(log.loop_to), len(log.ids)) == sizes
    found = squared(dataset)
    assert found.mean == pytest.approx(chi2, abs=1e-3)
    assert found.freedom == 3 * (sizes[0] - 1 + sizes[1]) + 2 * sizes[2]
    if sizes[2]:
        assert truth.map is not None
        assert len(truth.map.ids) == 100
        np.testing.assert_array_equal(truth.map.xy % 5, 2.5)


def test_they_are_fetched_out_of_an_archive_whatever_the_truth_is_called_there(
    serve: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = at_hand("posegraphs")
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    plain = {file.stem: gzip.decompress(file.read_bytes()) for file in folder.glob("*.txt.gz")}
    archive = serve(content=zipped(plain, "isam-master/data/")).url
    for name, stem in FILES.items():
        assert main(["fetch", name, "--quiet", "--url", archive]) == 0
        assert {file.name for file in place(name).iterdir()} == {*PUBLISHED[name].files, "SHA256SUMS"}
        assert main(["fetch", name, "--quiet", "--from", str(folder)]) == 0  # gzipped
        assert main(["fetch", name, "--quiet", "--check"]) == 0
        assert load(name).log.digest == load(f'{name}[path="{folder}/{stem}.txt.gz"]').log.digest
