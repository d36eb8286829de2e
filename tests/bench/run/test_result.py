import base64
import dataclasses
import html
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import slamduel
from random_logs import random_log
from slamduel.bench.run.benchmark import folder_for
from slamduel.bench.run.result import Result
from slamduel.core.factors import Dataset
from slamduel.datasets.formats import log_folder


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
    np.testing.assert_array_equal(kept.truth.poses, world.truth.poses)


def test_runs_of_the_same_second_have_a_folder_each(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "strftime", lambda _: "20260102-030405")
    with folder_for(None) as one, folder_for(None) as two, folder_for(None) as three:  # at once
        folders = [one, two, three]
        assert [folder.name for folder in folders] == ["20260102-030405", "20260102-030405-2", "20260102-030405-3"]
        (two / "a file").touch()
    assert [folder.exists() for folder in folders] == [False, True, False]
    with folder_for(None) as again:
        assert again == one
    (two / "a file").unlink()
    two.rmdir()
    with folder_for(None):
        pass
    assert not Path("results").exists()
    Path("results").touch()
    with (
        pytest.raises(slamduel.InputError, match=r"cannot be made \(Not a directory\); expected --out"),
        folder_for(None),
    ):
        pass


def test_paths_come_back_as_arrays(world: Dataset, result: Result) -> None:
    t, poses = result.path("isam2", final=True)
    np.testing.assert_array_equal(t, world.log.t)
    assert poses.shape == (40, 3)
    assert not np.array_equal(poses, result.path("isam2")[1])
    with pytest.raises(slamduel.SlamduelError, match="ekf, seed 0: the cell has no final path"):
        result.path("ekf", final=True)
    with pytest.raises(slamduel.SlamduelError, match="ukf, seed 0: found 0 cells done"):
        result.path("ukf")


def test_the_verdict_is_by_dataset(result: Result) -> None:
    ((dataset, found),) = result.verdict.items()
    assert dataset.endswith("logs/random]")
    assert "1 log" in found.basis
    assert {use.purpose for use in found.uses} <= {"online", "final", "map"}
    assert set(found.comparisons) <= set(result.cells[0])
    for use in found.uses:
        assert use.why.rstrip(".") in " ".join(repr(result).split())  # what a notebook without pages shows
    assert "random, 1 log" in repr(result)


def test_it_shows_itself(result: Result) -> None:
    text = repr(result)
    assert "isam2" in text
    assert str(result.report) in text
    page = result._repr_html_()  # pyright: ignore[reportPrivateUsage]
    assert result.verdict["log[path=" + str(result.folder / "logs" / "random") + "]"].sentences[0] in html.unescape(
        page
    )
    assert "<table" in page
    pictures = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)
    assert len(pictures) == 2
    assert base64.b64decode(pictures[0]).startswith(b"<svg")
    assert "<style" not in page  # nothing that would reach the notebook around it
    assert page.count("<div") == page.count("</div>")


@pytest.mark.usefixtures("no_report")
def test_the_same_again_goes_on_and_another_log_does_not(world: Dataset, result: Result) -> None:
    again = slamduel.run(world.log, "ekf,isam2", truth=world.truth, out=result.folder)
    assert again.cells == result.cells
    with pytest.raises(slamduel.SlamduelError, match="holds another log named random"):
        slamduel.run(world.log.head(20), "ekf,isam2", out=result.folder)


@pytest.mark.usefixtures("no_report")
def test_another_truth_is_another_log(tmp_path: Path, world: Dataset) -> None:
    other = world.truth._replace(poses=world.truth.poses + np.array([1.0, 0, 0]))
    slamduel.run(world.log, "dead-reckoning", truth=world.truth, out=tmp_path / "run")
    for truth in (other, None):
        with pytest.raises(slamduel.SlamduelError, match="or another truth of it"):
            slamduel.run(world.log, "dead-reckoning", truth=truth, out=tmp_path / "run")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"jobs": 0}, "jobs: found 0, expected a whole number, at least 1"),
        ({"jobs": "a"}, "jobs: found 'a'"),
        ({"timeout_s": "x"}, "timeout_s: found 'x', expected a number above 0"),
        ({"timeout_s": -1}, "timeout_s: found -1"),
        ({"timeout_s": np.nan}, "timeout_s: found nan"),
        ({"memory_mb": 0}, "memory_mb: found 0"),
        ({"seeds": 2.5}, r"seeds: found 2\.5, expected a whole number, at least 1"),
        ({"seeds": "3"}, "seeds: found '3'"),
        ({"seeds": True}, "seeds: found True"),
        (
            {"dataset": "circle", "backend": ["ekf", "isam2"], "seeds": 2001},
            "seeds: found 2,001, expected at most 2,000 to compare backends on",
        ),
        ({"oracle": "no"}, "oracle: found 'no', expected True or False"),
        ({"map": 5}, "map: found 5, expected a text"),
        ({"out": 5}, "out is 5, expected a text or a Path"),
        ({"backend": 5}, "backend is 5, expected names"),
        ({"backend": [None]}, r"backend is \[None\], expected names"),
        ({"dataset": 5}, "dataset is 5, expected a name"),
        ({"dataset": [None]}, "dataset is None, expected a name"),
        ({"dataset": []}, "dataset is empty"),
        ({"dataset": None}, "dataset is None, expected a name, a path, a Log or a Dataset"),
        ({"truth": 5}, "truth: found int, expected a Truth"),
        ({"dataset": "victoria-prak"}, "^slamduel.run: there is no dataset"),
        ({"backend": "ekff"}, "^slamduel.run: there is no backend"),
        ({"dataset": "log[path=]"}, "dataset log: option path is empty"),
        ({"dataset": Path('a"b')}, "found a double quote in the path"),
    ],
)
def test_a_wrong_argument_is_named_and_nothing_is_left(
    tmp_path: Path, world: Dataset, arguments: dict[str, Any], sentence: str
) -> None:
    given: dict[str, Any] = {"dataset": world.log, "backend": "ekf", "out": tmp_path / "made" / "run"} | arguments
    with pytest.raises(slamduel.SlamduelError, match=sentence):
        slamduel.run(**given)
    assert not list(tmp_path.iterdir())


def test_a_pair_of_a_log_and_nothing_is_no_dataset(tmp_path: Path, world: Dataset) -> None:
    pair: Any = (world.log, None)
    with pytest.raises(slamduel.SlamduelError, match="dataset is None, expected a name, a path, a Log or a Dataset"):
        slamduel.run(pair, out=tmp_path / "run")


def test_two_logs_of_one_name_are_told_apart_by_nobody(tmp_path: Path, world: Dataset) -> None:
    other = dataclasses.replace(world.log, name="a b")
    with pytest.raises(slamduel.SlamduelError, match="logs named 'a b' and 'a-b'"):
        slamduel.run([other, dataclasses.replace(other, name="a-b")], "ekf", out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_run_refused_at_the_last_moment_leaves_no_log(tmp_path: Path, world: Dataset) -> None:
    with pytest.raises(slamduel.SlamduelError, match="there is no such folder"):
        slamduel.run([world.log, "./not/there"], "ekf", out=tmp_path / "made" / "run")
    assert not list(tmp_path.iterdir())


def test_a_log_refused_by_a_run_that_is_there_is_not_written(world: Dataset, result: Result) -> None:
    with pytest.raises(slamduel.SlamduelError, match="holds a run with dataset"):
        slamduel.run(dataclasses.replace(world.log, name="second"), "ekf,isam2", out=result.folder)
    assert [place.name for place in (result.folder / "logs").iterdir() if place.is_dir()] == ["random"]


@pytest.mark.usefixtures("no_report")
def test_a_path_is_a_path_whatever_it_is_called(
    tmp_path: Path, world: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    places = [Path("city"), Path("x,y/log"), Path("br[1]/log"), Path("none"), Path(" a ")]
    for place in places:
        place.parent.mkdir(exist_ok=True)
        log_folder.write(place, *world)
        assert slamduel.load(place).log.digest == world.log.digest
    found = slamduel.run(places, "dead-reckoning", out="run").cells
    assert [cell["digest"] for cell in found] == [world.log.digest] * len(places)
    again = slamduel.run(places, "dead-reckoning", out="run").cells
    assert again == found
    assert slamduel.load('"x,y/log"').log.digest == slamduel.load('"br[1]/log"').log.digest == world.log.digest


@pytest.mark.parametrize(("name", "seed"), [(5, 0), ("circle", -1), ("circle", "1")])
def test_load_refuses_what_is_none(name: Any, seed: Any) -> None:
    with pytest.raises(slamduel.SlamduelError, match=r"slamduel\.load: (name|seed): found"):
        slamduel.load(name, seed)


def test_a_truth_belongs_to_one_log(tmp_path: Path, world: Dataset) -> None:
    with pytest.raises(slamduel.SlamduelError, match="expected one Log that it belongs to"):
        slamduel.run(["circle", "city"], "ekf", truth=world.truth, out=tmp_path / "run")


@pytest.mark.slow
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
    assert done.stdout.splitlines() == ["set()", "<class 'slamduel.core.factors.robot_log.Log'>"]
    assert set(slamduel.__all__) <= set(dir(slamduel))
    with pytest.raises(AttributeError, match="has no attribute 'Runn'"):
        _ = slamduel.Runn  # pyright: ignore[reportAttributeAccessIssue]
    assert [getattr(slamduel, name) for name in slamduel.__all__]


def test_a_log_says_what_it_is(world: Dataset) -> None:
    assert repr(world.log).startswith("<Log 'random': 40 steps, ")
