"""Datasets of many logs: patterns, files that name logs, published sets."""

import re
from pathlib import Path

import numpy as np
import pytest

from random_logs import random_log
from slamduel.bench.engine.key import log_key
from slamduel.bench.plan.load import load, made, one
from slamduel.bench.plan.many import is_pattern, matches
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.spec import dataset_variants
from slamduel.bench.run.benchmark import DEFAULTS, planned
from slamduel.bench.words.names import called
from slamduel.core.errors import InputError
from slamduel.datasets.formats import log_folder


@pytest.fixture
def drives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three logs, by numbers of one and two digits."""
    for k in (1, 2, 10):
        log_folder.write(tmp_path / f"drives/d{k}", *random_log(np.random.default_rng(k), 10 + k, 3))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def listed(path: Path, text: str) -> str:
    (path / "list.toml").write_text(text)
    return "list.toml"


def names(text: str) -> list[tuple[str | None, str | None]]:
    (variant,) = dataset_variants(text)
    found = [variant.log(seed) for seed in range(len(variant.members))]
    return [(log.name, log.cluster) for log in found]


@pytest.mark.usefixtures("drives")
@pytest.mark.parametrize("text", ["log[path=drives/*]", "drives/*", '"drives/d*"', "drives/d?,drives/d10"])
def test_a_pattern_is_one_dataset_with_a_seed_per_log(text: str) -> None:
    if "," in text:
        assert [len(variant.members) for variant in dataset_variants(text)] == [2, 0]
        return
    assert [name for name, _ in names(text)] == ["drives/d1", "drives/d2", "drives/d10"]  # by number, not by letter
    (variant,) = dataset_variants(text)
    assert [len(made(variant, seed).log) for seed in range(3)] == [11, 12, 20]
    assert load("drives/*", 2).log.digest == load("drives/d10").log.digest
    with pytest.raises(InputError, match=r"found seed 3, expected 0 to 2, one for each of its logs\."):
        made(variant, 3)


@pytest.mark.usefixtures("drives")
def test_a_named_log_of_a_file_has_its_name_and_is_the_same_log_under_any(tmp_path: Path) -> None:
    entries = "".join(f"[[logs]]\ndataset = '{one}'\n" for one in ("log[name=monday,path=drives/d1]", "drives/d2"))
    assert [name for name, _ in names(listed(tmp_path, entries))] == ["monday", "drives/d2"]
    twice = entries + "[[logs]]\ndataset = 'log[name=friday,path=drives/d1]'\n"
    with pytest.raises(InputError, match="found the same log twice, monday and friday"):
        dataset_variants(listed(tmp_path, twice))


@pytest.mark.usefixtures("drives")
def test_every_log_is_run_once_by_every_backend_whatever_the_seeds() -> None:
    def cells(dataset: str, seeds: int) -> list[tuple[str, int]]:
        words = DEFAULTS | {"dataset": dataset, "backend": "ekf,fastslam", "seeds": seeds}
        return [(cell.backend.name, cell.seed) for cell in Plan.from_words(words).cells()]

    assert cells("drives/*", 2) == [(name, k) for name in ("ekf", "fastslam") for k in range(3)]
    assert cells("drives/d1*", 2) == cells("drives/*", 2)[:2] + cells("drives/*", 2)[3:5]
    one_log = [("ekf", 0), ("fastslam", 0), ("fastslam", 1)]
    assert cells("drives/d1", 2) == cells("drives/d2*", 2) == one_log  # a pattern that fits one log is that log


@pytest.mark.usefixtures("drives")
def test_a_cell_of_many_logs_is_told_by_its_name_and_not_by_a_seed_that_nothing_is_drawn_with() -> None:
    for dataset, wanted in (("drives/*", "drives/d10"), ("circle", "seed 2"), ("drives/d1", "seed 2")):
        words = DEFAULTS | {"dataset": dataset, "backend": "fastslam", "seeds": 3}
        last = Plan.from_words(words).cells()[-1]
        assert last.which == wanted
        assert str(last).endswith(f"fastslam · {wanted}")


@pytest.mark.usefixtures("drives")
def test_a_number_of_seeds_for_such_datasets_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"seeds: found 2, expected none, or 1: log\[path=drives/\*\] has 3 logs, and all"
    ):
        planned({"dataset": "drives/*", "seeds": 2}, tmp_path / "out")
    assert planned({"dataset": "drives/*", "seeds": 3}, tmp_path / "out").seeds == 3
    assert len(planned({"dataset": "drives/*", "seeds": 1, "backend": "ekf"}, tmp_path / "out").cells()) == 3
    assert planned({"dataset": "drives/*,circle", "seeds": 2}, tmp_path / "out").seeds == 2
    assert len(planned({"dataset": "drives/*", "backend": "ekf"}, tmp_path / "out").cells()) == 3


@pytest.mark.usefixtures("drives")
def test_a_log_has_the_same_key_by_itself_and_among_many() -> None:
    (many,), (alone,) = dataset_variants("drives/*"), dataset_variants("drives/d2")
    assert log_key(many.log(1)) == log_key(alone.log(0)) != log_key(many.log(0))


def test_what_a_pattern_may_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a[1]x", "a[1]y", "what?"):
        (tmp_path / name).mkdir()
    assert matches("a[1]*") == ["a[1]x", "a[1]y"]  # brackets are letters
    assert not is_pattern("what?")  # there is one of this very name
    assert not is_pattern("a[1]x")
    with pytest.raises(InputError, match=r"^drives/\*: nothing fits this pattern, expected one or more logs\.$"):
        dataset_variants("drives/*")
    (tmp_path / "mixed").mkdir()
    (tmp_path / "mixed/a.g2o").write_text("VERTEX_SE2 0 0 0 0\n")
    (tmp_path / "mixed/folder").mkdir()
    with pytest.raises(InputError, match=r"mixed/\*: found datasets of several kinds, .*; expected one, or"):
        dataset_variants("mixed/*")


def test_the_name_of_a_pattern_says_where() -> None:
    assert called(["log[path=runs/drives/*]"]) == {"log[path=runs/drives/*]": "drives/*"}
    assert called(["log[path=runs/drives/d?/x*]"]) == {"log[path=runs/drives/d?/x*]": "drives/d?/x*"}
    assert called(["log[path=*]"]) == {"log[path=*]": "*"}
    assert called(["log[path=runs/kitchen]"]) == {"log[path=runs/kitchen]": "kitchen"}


def test_a_file_names_logs_and_clusters(drives: Path) -> None:
    file = listed(
        drives,
        '[[logs]]\npath = "drives/d10"\ncluster = "monday"\n'
        '[[logs]]\npath = "drives/d?"\ncluster = "tuesday"\n'
        '[[logs]]\ndataset = "circle[steps=30]"\nseed = 3\n'
        '[[logs]]\ndataset = "circle[steps=30]"\n',
    )
    assert names(file) == names(f"logs[path={file}]") == [
        ("drives/d10", "monday"),
        ("drives/d1", "tuesday"),
        ("drives/d2", "tuesday"),
        ("circle[steps=30], seed 3", None),
        ("circle[steps=30]", None),
    ]  # fmt: skip
    found = one(file, "here")
    assert made(found, 0).log.digest == load("drives/d10").log.digest
    assert made(found, 3).log.digest == load("circle[steps=30]", 3).log.digest
    plan = Plan.from_words(DEFAULTS | {"dataset": file, "backend": "ekf"})
    assert plan.words()["logs"][f"logs[path={file}]"][0] == ["log[path=./drives/d10]", "monday"]
    assert Plan.from_words(plan.words()) == plan


def test_the_file_may_lie_elsewhere(drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed(drives, '[[logs]]\npath = "drives/*"\n')
    (tmp_path / "below").mkdir(exist_ok=True)
    monkeypatch.chdir(tmp_path / "below")
    assert len(made(one("../list.toml", "here"), 2).log) == 20


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"list\.toml: the file is empty\."),
        ("logs = []", r"list\.toml: found no logs, expected one or more tables \[\[logs\]\]\."),
        ('name = "x"', r"list\.toml, line 1: name: there is no such key"),
        ('logs = "x"', r"list\.toml, line 1: logs: found 'x', expected tables, \[\[logs\]\]"),
        ('[[logs]]\npaths = "x"', r"list\.toml, line 2: logs\.paths: there is no such key; did you mean 'path'\?"),
        ('[[logs]]\ncluster = "x"', r"list\.toml, line 1: logs has no 'path', expected a path or a dataset, one of"),
        ('[[logs]]\npath = "a"\ndataset = "b"', r"line 1: logs has no 'path', expected a path or a dataset, one of"),
        ('[[logs]]\npath = "drives/d1"\ncluster = 6', r"line 3: logs\.cluster: found 6, expected a text in quotes"),
        ('[[logs]]\npath = "drives/d1"\ncluster = " "', r"logs\.cluster: found ' ', expected a text in quotes"),
        ("[[logs]]\npath = 3", r"logs\.path: found 3, expected a text in quotes"),
        ("[[logs]]\npath = 'a\"b'", r"logs\.path: found a double quote in the path, expected one without"),
        ('[[logs]]\npath = "drives/z*"', r"drives/z\*: nothing fits this pattern"),
        ('[[logs]]\ndataset = "nothing"', r"list\.toml: dataset: there is no dataset 'nothing'"),
        ('[[logs]]\ndataset = "circle"\nseed = -1', r"logs\.seed: found -1, expected a whole number, at least 0"),
        ('[[logs]]\npath = "drives/d1"\nseed = 1', r"logs\.path: drives/d1 draws nothing at random, expected no seed"),
        ('[[logs]]\npath = "drives/d*"\nseed = 1', r"logs\.path: drives/d\* draws nothing at random, expected no seed"),
        ('[[logs]]\npath = "list.toml"', r"logs\.path: list\.toml is a file of logs again, expected one log"),
        ('[[logs]]\ndataset = "logs[path=list.toml]"', r"is a file of logs again, expected one log or a dataset"),
        (2 * '[[logs]]\npath = "drives/d1"\n', r"found the same log twice, drives/d1; expected each log once\."),
        (
            '[[logs]]\npath = "drives/d1"\n[[logs]]\npath = "drives/../drives/*"\n',
            r"found the same log twice, drives/d1; expected each log once\.",
        ),
        (2 * '[[logs]]\ndataset = "circle"\n', r"found the same log twice, circle; expected each log once\."),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_a_sentence(drives: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        dataset_variants(listed(drives, text))
    assert "\n" not in str(refused.value)


def test_without_its_file_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"option path of dataset logs is not given, expected a TOML file"):
        dataset_variants("logs")
    with pytest.raises(InputError, match=re.escape("gone.toml")):
        dataset_variants("gone.toml")


def test_all_robots_and_all_sets_of_mrclam_are_logs_of_their_sets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))  # nothing was fetched
    five = names("mrclam[robot=all]")
    assert five == [(f"set 6, robot {k}", "set 6") for k in range(1, 6)]
    assert names("mrclam[dataset=all,robot=2]") == [(f"set {k}, robot 2", f"set {k}") for k in range(1, 10)]
    every = names("mrclam-all")
    assert every == names("mrclam[dataset=all,robot=all]")
    assert (len(every), len({cluster for _, cluster in every})) == (45, 9)
    assert names("mrclam-all[dataset=6]") == five
    (two,), (alone,) = dataset_variants("mrclam-all[range_sd=0.3]"), dataset_variants("mrclam[robot=2,range_sd=0.3]")
    assert log_key(two.log(26)) == log_key(alone.log(0))
    assert str(two.log(26)) == "mrclam[robot=2,range_sd=0.3]"
    assert not dataset_variants("mrclam[robot=2]")[0].members
