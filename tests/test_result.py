import base64
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import slamduel
from slamduel.bench.result import Result
from slamduel.frontend.factors import Dataset
from textbook import random_log


@pytest.fixture(scope="module")
def world() -> Dataset:
    return random_log(np.random.default_rng(3), 40, 8)


@pytest.fixture(scope="module")
def result(world: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Result:
    return slamduel.run(world.log, ["ekf", "isam2"], truth=world.truth, out=tmp_path_factory.mktemp("api") / "run")


def test_a_log_in_python_is_run_as_it_is(world: Dataset, result: Result) -> None:
    assert [cell["backend"] for cell in result.cells] == ["ekf", "isam2"]
    for cell in result.cells:
        assert (cell["status"], cell["digest"], cell["truth_kind"]) == ("done", world.log.digest, "truth")
        assert cell["ate_m"] < 0.2
    assert result.report.is_file()
    kept = slamduel.load(result.folder / "logs" / "random")
    assert kept.log.digest == world.log.digest
    assert kept.truth is not None
    assert world.truth is not None
    np.testing.assert_array_equal(kept.truth.poses, world.truth.poses)


def test_paths_come_back_as_arrays(world: Dataset, result: Result) -> None:
    t, poses = result.path("isam2", final=True)
    np.testing.assert_array_equal(t, world.log.t)
    assert poses.shape == (40, 3)
    assert not np.array_equal(poses, result.path("isam2")[1])
    with pytest.raises(slamduel.SlamduelError, match="ekf, seed 0: the cell has no final path"):
        result.path("ekf", final=True)
    with pytest.raises(slamduel.SlamduelError, match="ukf, seed 0: found 0 cells done"):
        result.path("ukf")


def test_it_shows_itself(result: Result) -> None:
    text = repr(result)
    assert "isam2" in text
    assert str(result.report) in text
    page = result._repr_html_()  # pyright: ignore[reportPrivateUsage]
    assert "lowest error" in page
    assert "<table" in page
    pictures = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)
    assert len(pictures) == 2
    assert base64.b64decode(pictures[0]).startswith(b"<svg")
    assert "<style" not in page  # nothing that would reach the notebook around it
    assert page.count("<div") == page.count("</div>")


def test_the_same_again_goes_on_and_another_log_does_not(world: Dataset, result: Result) -> None:
    again = slamduel.run(world.log, "ekf,isam2", truth=world.truth, out=result.folder)
    assert again.cells == result.cells
    with pytest.raises(slamduel.SlamduelError, match="holds another log named random"):
        slamduel.run(world.log.head(20), "ekf,isam2", out=result.folder)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"backend": "ekff"}, "there is no backend 'ekff'"),
        ({"timeout": 3}, "there is no argument 'timeout'"),
        ({"dataset": "roomm"}, "there is no dataset 'roomm'"),
    ],
)
def test_what_cannot_be_used_is_a_sentence_and_leaves_nothing(
    tmp_path: Path, world: Dataset, arguments: dict[str, str], sentence: str
) -> None:
    with pytest.raises(slamduel.SlamduelError, match=sentence):
        slamduel.run(**{"dataset": world.log, "out": tmp_path / "run"} | arguments)  # pyright: ignore[reportArgumentType]
    assert not (tmp_path / "run").exists()


def test_a_truth_belongs_to_one_log(tmp_path: Path, world: Dataset) -> None:
    with pytest.raises(slamduel.SlamduelError, match="expected one Log that it belongs to"):
        slamduel.run(["circle", "city"], "ekf", truth=world.truth, out=tmp_path / "run")


def test_a_script_without_a_guard_is_not_run_again_by_its_workers(tmp_path: Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text(
        "import slamduel\n"
        "print('begun')\n"
        "found = slamduel.run('circle[steps=20]', 'ekf', seeds=1, out='run')\n"
        "print(found.cells[0]['status'])\n"
    )
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "begun\ndone\n", "")


def test_importing_costs_nothing() -> None:
    code = "import sys, slamduel; print({'numpy', 'gtsam', 'slamduel.bench'} & set(sys.modules)); print(slamduel.Log)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines() == ["set()", "<class 'slamduel.frontend.factors.Log'>"]
    assert set(slamduel.__all__) <= set(dir(slamduel))
    with pytest.raises(AttributeError, match="has no attribute 'Runn'"):
        _ = slamduel.Runn  # pyright: ignore[reportAttributeAccessIssue]
    assert [getattr(slamduel, name) for name in slamduel.__all__]


def test_a_log_says_what_it_is(world: Dataset) -> None:
    assert repr(world.log).startswith("<Log 'random': 40 steps, ")
