"""Study files: what they say becomes cells, and what is wrong with one is a sentence with its line."""

import itertools
import tomllib
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from slamduel.bench.plan.spec import backend_variants, dataset_variants
from slamduel.bench.study.file import FORMAT, packaged, read, reread
from slamduel.bench.study.only import choice
from slamduel.bench.study.toml_lines import Place, lines
from slamduel.frontend.errors import InputError
from study_text import HEAD, study

CLAIM = '[[claim]]\nsays = "x"\nmeasure = "ate_m"\n'


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        study(text)
    return str(caught.value)


def test_cells_are_what_itertools_makes_of_the_file_by_hand() -> None:
    found = study("""
        [[cells]]
        dataset = ["bailey", "bailey[range_noise=0.2]"]
        backend = ["fastslam", "fastslam[version=1]"]
        seeds = 2
        grid.backend.particles = [10, 1_000]
        grid."dataset.landmarks" = [5, 6]
        zip."backend.resampling" = ["systematic", "residual"]
        zip."backend.resample_below" = [0.5, 1]
        list = [{ "dataset.loops" = 3 }, { dataset.loops = 4, dataset.reach = 20 }]
    """)
    expected: set[tuple[Any, ...]] = set()
    datasets, backends = ("bailey", "bailey[range_noise=0.2]"), ("fastslam", "fastslam[version=1]")
    zipped, listed = (("systematic", 0.5), ("residual", 1)), ((3, ""), (4, ",reach=20"))
    for d, b, (r, below), (loops, more), n, m, seed in itertools.product(
        datasets, backends, zipped, listed, (10, 1000), (5, 6), range(2)
    ):
        options = f"particles={n},resampling={r},resample_below={below}"
        world = f"landmarks={m},loops={loops}{more}"
        backend = f"{b[:-1]},{options}]" if b.endswith("]") else f"{b}[{options}]"
        dataset = f"{d[:-1]},{world}]" if d.endswith("]") else f"{d}[{world}]"
        (one,), (other,) = dataset_variants(dataset), backend_variants(backend)
        expected.add((one, other, seed, d, b, n, m, r, below, loops))
    names = ("dataset", "backend", "particles", "landmarks", "resampling", "resample_below", "loops")
    cells = [(c.cell.dataset, c.cell.backend, c.cell.seed, *(c.parameters[n] for n in names)) for c in found.cells]
    assert len(cells) == 2**7
    assert set(cells) == expected
    assert all(c.parameters["seed"] == c.cell.seed for c in found.cells)
    assert {c.parameters["reach"] for c in found.cells} == {20, dataset_variants("bailey")[0].options.reach}


def test_blocks_add_up_and_a_block_has_its_own_value_of_what_another_sweeps() -> None:
    found = study("""
        [[cells]]
        dataset = "bailey"
        backend = "fastslam"
        grid.backend.particles = [10, 20]
        [[cells]]
        dataset = "bailey"
        backend = ["fastslam[particles=30]", "fastslam", "ekf"]
        seeds = [4, 7]
    """)
    seen = [tuple(cell.parameters[name] for name in ("backend", "particles", "seed")) for cell in found.cells]
    assert seen == [
        ("fastslam", 10, 0), ("fastslam", 20, 0), ("fastslam[particles=30]", 30, 4), ("fastslam[particles=30]", 30, 7),
        ("fastslam", 500, 4), ("fastslam", 500, 7), ("ekf", None, 4), ("ekf", None, 7),
    ]  # fmt: skip
    assert found.parameters == ("dataset", "backend", "seed", "particles")


def test_an_option_of_both_sides_goes_by_its_full_name_and_none_is_a_value() -> None:
    found = study("""
        [[cells]]
        dataset = "recording"
        backend = "tests_of_slamduel.no_such_module:build"
        list = [{ "dataset.path" = "a" }, { "backend.path" = 2, "dataset.path" = "b" }, { "dataset.path" = "none" }]
    """)
    paths = [(cell.parameters["dataset.path"], cell.parameters["backend.path"]) for cell in found.cells]
    assert paths == [("a", None), ("b", 2), ("none", None)]
    assert {cell.cell.backend.builder for cell in found.cells} == {None}
    assert all("cannot be imported" in cell.cell.backend.missing for cell in found.cells)


def test_what_draws_nothing_runs_for_one_seed(tmp_path: Path) -> None:
    found = study(f"""
        seeds = 3
        [[cells]]
        dataset = "{tmp_path}"
        backend = ["ekf", "fastslam"]
    """)
    assert [(c.cell.backend.name, c.cell.seed) for c in found.cells] == [("ekf", 0)] + [
        ("fastslam", k) for k in (0, 1, 2)
    ]
    assert found.cells[0].cell.dataset.options.path == str(tmp_path)


def test_seeds_are_counted_from_the_first_one() -> None:
    def seeds(head: str, block: str = "") -> list[int]:
        return [c.cell.seed for c in study(f"{head}\n[[cells]]\ndataset = 'bailey'\nbackend = 'ekf'\n{block}\n").cells]

    assert seeds("seeds = 2\nfirst_seed = 1000") == [1000, 1001]
    assert seeds("first_seed = { quick = 7, full = 0 }") == [7]
    assert seeds("seeds = 2\nfirst_seed = 1000", "first_seed = 3") == [3, 4]
    assert seeds("first_seed = 1000", "seeds = 2") == [1000, 1001]
    assert seeds("first_seed = 1000", "seeds = [4, 7]") == [4, 7]


def test_sizes_are_chosen_wherever_they_stand() -> None:
    text = HEAD + '[[figure]]\nx = { quick = "loops", full = "particles" }\ny = "ate_m"\nwhere.backend = "fastslam"\n'
    text = text.replace("seeds = 3", "seeds = { quick = 1, full = 2 }")
    quick, full = study(text), study(text, full=True)
    assert (quick.size, len(quick.cells), quick.figures[0].x) == ("quick", 8, "loops")
    assert (full.size, len(full.cells), full.figures[0].x) == ("full", 16, "particles")


def test_a_time_makes_a_study_timed_unless_it_says_otherwise() -> None:
    figure = '[[figure]]\nx = "loops"\ny = "step_us_mean"\n'
    assert not any(cell.timed for cell in study(HEAD).cells)
    assert all(cell.timed for cell in study(HEAD + figure).cells)
    assert not any(cell.timed for cell in study("timed = false\n" + HEAD + figure).cells)
    one = study(HEAD.replace('"fastslam"', '"fastslam"\ntimed = false') + figure)
    assert {cell.cell.backend.name: cell.timed for cell in one.cells} == {
        "ekf": True, "dead-reckoning": True, "fastslam": False,
    }  # fmt: skip


def test_claims_and_the_words_of_a_study_are_read() -> None:
    found = study(
        'question = "q"\nnote = "n"\nkeep = true\ntimeout_s = 5\nmemory_mb = 100\n'
        + HEAD
        + CLAIM
        + 'less.backend = "ekf"\nthan.backend = "dead-reckoning"\nfactor = 2\neach = "loops"\n'
        + CLAIM
        + 'alike.backend = "ekf"\nto = { backend = "dead-reckoning", measure = "final_ate_m" }\nby = 0.25\n'
        + "where.loops = 1\n"
        + CLAIM
        + 'grows = "loops"\nof.backend = "ekf"\nabove = 1\n'
        + CLAIM
        + 'less.backend = "fastslam"\nthan.backend = "ekf"\nwhere.loops = 2\ncrosses = "particles"\nwithin = [10, 20]\n'
        + CLAIM
        + 'of.backend = "fastslam"\nwhere.loops = 2\nbelow = 0.5\neach = "particles"\n'
    )
    assert (found.question, found.note, found.keep, found.timeout_s, found.memory_mb) == ("q", "n", True, 5.0, 100)
    seen = [(c.kind, c.low, c.high, c.along, c.each) for c in found.claims]
    inf = float("inf")
    assert seen == [
        ("less", 2.0, inf, "", "loops"), ("alike", 0.8, 1.25, "", ""), ("grows", 1.0, inf, "loops", ""),
        ("crosses", 10.0, 20.0, "particles", ""), ("value", -inf, 0.5, "", "particles"),
    ]  # fmt: skip
    assert reread("s", found.text, full=False).claims == found.claims
    assert reread("s.v2", found.text, full=False).name == "s.v2"


ERRORS = {
    "no TOML": ("a = 1\nb = = 2\n", "s.toml, line 2: not valid TOML at column 5: Invalid value; expected a TOML file."),
    "an unknown key": ("titel = 1\n", "s.toml, line 1: titel: there is no such key; did you mean 'title'?"),
    "no cells": ('title = "x"\n', "s.toml: the file has no 'cells', expected [[cells]] with a dataset and a backend."),
    "cells as a table": ("[cells]\n", "s.toml, line 1: cells: found an empty table, expected [[cells]] with a dataset"),
    "a title that is none": ("\ntitle = 3\n", "s.toml, line 2: title: found 3, expected a text."),
    "a limit of exabytes": ("memory_mb = 1000000000000\n", "line 1: memory_mb: found 1000000000000, expected a whole"),
    "a number of 20 digits": (
        "seeds = 1\ntimeout_s = 12345678901234567890\n", "s.toml, line 2: found a whole number of 20 digits, expected",
    ),
    "thousands of digits": ("seeds = 1" + "0" * 5000, "s.toml: not valid TOML: Exceeds the limit"),
    "tables in tables": (".".join("a" * 2000) + " = 1", "s.toml: found tables or lists that are hundreds deep"),
    "a key without a letter": ('"" = 1\n', "s.toml, line 1: '': there is no such key; expected one of"),
    "a switch that is none": ("keep = 1\n", "line 1: keep: found 1, expected true or false."),
    "a limit of nothing": ("timeout_s = 0\n", "line 1: timeout_s: found 0, expected a number above 0."),
    "a limit that is true": (
        "memory_mb = true\n",
        "line 1: memory_mb: found true, expected a whole number, at least 1 and at most 1,000,000,000.",
    ),
    "a block without a backend": (
        '[[cells]]\ndataset = "bailey"\n',
        "line 1: cells has no 'backend', expected a text or",
    ),
    "a half size": ("x = 1\nseeds = { quick = 3 }\n", "line 2: seeds: found quick, expected quick and full, each with"),
    "three sizes": (
        "seeds = { quick = 3, full = 4, huge = 5 }\n",
        "line 1: seeds: found quick and full and huge, expected",
    ),
}  # fmt: skip

BLOCK = '[[cells]]\ndataset = "bailey"\nbackend = ["ekf", "fastslam"]\n'
CELL_ERRORS = {
    "seeds that are none": (
        "seeds = 0\n",
        "line 4: cells.seeds: found 0, expected a whole number, at least 1, or a list",
    ),
    "seeds without end": ("seeds = 2000000\n", "line 4: cells.seeds: found 2000000, expected at most as many"),
    "cells without end": ("seeds = 600000\n", "line 2: cells.dataset: with these there are 1,200,000 cells, expected"),
    "true seeds": ("seeds = true\n", "line 4: cells.seeds: found true, expected a whole number"),
    "no seed": ("seeds = []\n", "line 4: cells.seeds: found [], expected a whole number"),
    "a negative seed": ("seeds = [1, -1]\n", "line 4: cells.seeds: found [1, -1], expected a whole number"),
    "a seed twice": ("seeds = [1, 2, 1]\n", "line 4: cells.seeds: found [1, 2, 1], expected each seed once."),
    "a negative first seed": ("first_seed = -1\n", "line 4: cells.first_seed: found -1, expected a whole number, at"),
    "a first seed of a list": (
        "first_seed = 9\nseeds = [1, 2]\n",
        "line 4: cells.first_seed: the seeds are a list, expected how many there are from that one on.",
    ),
    "a misspelt key": ("gird = 1\n", "line 4: cells.gird: there is no such key; did you mean 'grid'?"),
    "a grid that is none": ("grid = 3\n", "line 4: cells.grid: found 3, expected a table, grid = { ... }."),
    "a name without a side": ("grid.loops = [1]\n", "line 4: 'loops': expected the name of an option, as in"),
    "an empty list": ("\n[cells.grid]\n'dataset.loops' = []\n", "line 6: dataset.loops: found [], expected a list of"),
    "no list": ("grid.dataset.loops = 3\n", "line 4: dataset.loops: found 3, expected a list of values, at least one."),
    "a value twice": (
        "grid.dataset.loops = [1,\n 2,\n 1]\n",
        "line 6: dataset.loops: found 1 twice, expected every value",
    ),
    "a value that is none": (
        "grid.dataset.loops = [1, [2]]\n",
        "line 4: dataset.loops: found [2], expected a number, a text",
    ),
    "a date": (
        "grid.dataset.loops = [2020-01-01]\n",
        "line 4: dataset.loops: found the time 2020-01-01, expected a number",
    ),
    "an option of nobody": (
        "grid.dataset.lops = [1]\n",
        "line 4: dataset.lops: dataset bailey has no option 'lops'; did you",
    ),
    "an option of some": (
        "grid.backend.particles = [1]\n",
        "has no option 'particles', expected it of every backend of the block; give fastslam a [[cells]] of its own.",
    ),
    "a value out of range": (
        "grid.dataset.loops = [\n  1,\n  0,\n]\n",
        "s.toml, line 6: dataset bailey: option loops=0 is out of range; expected a whole number from 1 to 50.",
    ),
    "a value of another kind": (
        "list = [{ dataset.loops = 1.5 }]\n",
        "line 4: dataset bailey: option loops=1.5: found '1.5'",
    ),
    "unequal lengths": (
        "\n[cells.zip]\ndataset.loops = [1, 2]\ndataset.landmarks = [3]\n",
        "line 5: cells.zip: found values in unequal numbers, 2 of dataset.loops, 1 of dataset.landmarks; expected",
    ),
    "a list of none": ("list = []\n", "line 4: cells.list: found [], expected a list of tables, as in list = [{"),
    "a list of numbers": ("list = [3]\n", "line 4: cells.list: found [3], expected a list of tables"),
    "an empty table": ("list = [{}]\n", "line 4: cells.list: found [an empty table], expected a list of tables"),
    "an option swept twice": (
        "grid.dataset.loops = [1]\nzip.dataset.loops = [2]\n",
        "line 5: dataset.loops is swept here and on line 4, expected",
    ),
    "an option named twice": (
        "grid.'dataset.loops' = [1]\ngrid.dataset.loops = [2]\n", "line 5: dataset.loops is given twice, expected once."
    ),
    "a cell twice": (
        "list = [{ dataset.loops = 1 }, { dataset.loops = 1 }]\n",
        "line 2: cells.dataset: bailey[loops=1] with ekf",
    ),
    "a cell of another block": (
        '[[cells]]\ndataset = "bailey"\nbackend = "ekf"\n',
        "line 5: cells.dataset: bailey with ekf is a cell of line 2 already, expected every cell once in a study.",
    ),
}  # fmt: skip

LABEL_ERRORS = {
    "an unknown dataset": (
        '"baily"', '"ekf"',
        "s.toml, line 2: dataset: there is no dataset 'baily'; did you mean 'bailey'?",
    ),
    "an unknown backend": (
        '"bailey"', '[\n"ekf",\n"efk"]',
        "s.toml, line 5: backend: there is no backend 'efk'; did you mean",
    ),
    "an unknown option": (
        '"bailey[lop=1]"', '"ekf"',
        "s.toml, line 2: dataset bailey: there is no option 'lop'; did you mean",
    ),
    "two in a text": (
        '"bailey"', '"ekf,ukf"',
        "line 3: backend: found 'ekf,ukf', expected one a text; several go in a list.",
    ),
    "a number": ('"bailey"', "3", "line 3: cells.backend: found 3, expected a text or a list of texts, at least one."),
    "none": ('"bailey"', "[]", "line 3: cells.backend: found [], expected a text or a list of texts, at least one."),
    "an open bracket": (
        '"bailey"', '"ekf[gate=1"',
        "s.toml, line 3: backend ekf[gate=1: expected every bracket and quote",
    ),
    "one twice": ('"bailey"', '["ekf", "ekf"]', "line 3: backend: found 'ekf' twice, expected once."),
    "a variant twice": (
        '["bailey", "bailey[loops=2]"]', '"ekf"',
        "line 2: cells.dataset: bailey with ekf is a cell twice",
    ),
}  # fmt: skip

CLAIM_ERRORS = {
    "no sentence": ("[[claim]]\nof.loops = 1\nbelow = 1\n", "line 15: claim has no 'says', expected a text."),
    "no kind": (CLAIM, "line 15: claim has no 'less', expected what it is about: one of of, less and than"),
    "a misspelt kind": (CLAIM + "les.loops = 1\n", "line 18: claim.les: there is no such key; did you mean 'less'?"),
    "a key of another kind": (
        CLAIM + "of.loops = 1\nfactor = 2\n",
        "line 19: claim.factor: there is no such key; expected one",
    ),
    "no other side": (CLAIM + "less.loops = 1\n", "line 15: claim has no 'than', expected the cells to compare with"),
    "no bounds": (
        CLAIM + "of.loops = 1\n",
        "line 15: claim has no 'above', expected above, below or within = [low, high].",
    ),
    "bounds the wrong way": (
        CLAIM + "of.loops = 1\nwithin = [2, 1]\n",
        "line 19: claim.within: found [2, 1], expected two",
    ),
    "a bound without end": (CLAIM + "of.loops = 1\nbelow = inf\n", "line 19: claim.below: found inf, expected a"),
    "bounds without end": (CLAIM + "of.loops = 1\nwithin = [0, inf]\n", "line 19: claim.within: found [0, inf]"),
    "a measure that is a number": (
        CLAIM + "of = { loops = 1, measure = 1 }\nbelow = 1\n", "line 18: claim.of.measure: found 1, expected a text."
    ),
    "bounds that cross": (
        CLAIM + "of.loops = 1\nabove = 2\nbelow = 1\n",
        "line 19: claim.above: found 2, expected less than",
    ),
    "bounds twice": (
        CLAIM + "of.loops = 1\nwithin = [1, 2]\nbelow = 1\n",
        "line 20: claim.below: is given beside within",
    ),
    "no factor": (
        CLAIM + "less.loops = 1\nthan.loops = 2\nfactor = 0\n",
        "line 20: claim.factor: found 0, expected a number",
    ),
    "no share": (CLAIM + "alike.loops = 1\nto.loops = 2\n", "line 15: claim has no 'by', expected a number above 0."),
    "an unknown column": (
        '[[claim]]\nsays = "x"\nmeasure = "ate"\nof.loops = 1\nbelow = 1\n',
        "line 17: claim.measure: there is no column 'ate'; did you mean 'ate_m'?",
    ),
    "a column of words": (
        '[[claim]]\nsays = "x"\nmeasure = "status"\nof.loops = 1\nbelow = 1\n',
        "line 17: claim.measure: column status is not",
    ),
    "another unknown column": (
        CLAIM + "less = { loops = 1, measure = 'atem' }\nthan.loops = 2\nwhere.backend = 'ekf'\n",
        "line 18: claim.less.measure: there is no column 'atem'; did you mean 'ate_m'?",
    ),
    "an unknown parameter": (
        CLAIM + "of.lops = 1\nbelow = 1\n",
        "line 18: claim.of.lops: no cell has a parameter 'lops'; did",
    ),
    "a value of no cell": (
        CLAIM + "of.loops = 3\nbelow = 1\n", "line 18: claim.of.loops: no cell has 3, expected one of 1, 2."
    ),
    "a value of no cell, for all": (
        CLAIM + "of.loops = 1\nbelow = 1\n[claim.where]\nbackend = 'efk'\n",
        "line 21: claim.where.backend: no cell has 'efk', expected one of 'ekf', 'dead-reckoning', 'fastslam'.",
    ),
    "values of no cell together": (
        CLAIM + "of = { backend = 'ekf', particles = 10 }\nbelow = 1\nwhere.loops = 1\n",
        "line 18: claim.of: no cell has backend = 'ekf' and particles = 10 together, expected a selection",
    ),
    "a parameter twice": (
        CLAIM + "of.loops = 1\nbelow = 1\nwhere.loops = 1\n",
        "line 18: claim.of.loops: is in where as well, expected in one",
    ),
    "the same cells": (
        CLAIM + "less.backend = 'ekf'\nthan.backend = 'ekf'\nwhere.loops = 1\n",
        "line 19: claim.than: found a table, expected other",
    ),
    "a quoted dot": (
        CLAIM + "of.dataset.loops = 1\nbelow = 1\n",
        "line 18: claim.of.dataset: found a table, expected a value; a name",
    ),
    "a list to select": (
        CLAIM + "of.loops = [1]\nbelow = 1\n",
        "line 18: claim.of.loops: found [1], expected a number, a text",
    ),
    "several configurations": (
        CLAIM + "of.backend = 'ekf'\nbelow = 1\n",
        "line 18: claim.of: has cells with loops = 1, 2, expected one value, by its own",
    ),
    "several without `of`": (
        CLAIM + "grows = 'loops'\nbelow = 1\n",
        "line 16: claim.says: has cells with backend = 'ekf', 'dead-reckoning', 'fastslam'",
    ),
    "each of nothing": (
        CLAIM + "of.backend = 'ekf'\nbelow = 1\neach = 'lops'\n",
        "line 20: claim.each: no cell has a parameter",
    ),
    "each of one": (
        CLAIM + "of = { backend = 'ekf', loops = 2 }\nbelow = 1\neach = 'loops'\n",
        "line 20: claim.each: found 'loops', expected a parameter that is swept; loops is 2 in all of its cells.",
    ),
    "each of what they lack": (
        CLAIM + "of = { backend = 'ekf', loops = 2 }\nbelow = 1\neach = 'particles'\n",
        "line 20: claim.each: found 'particles', expected",
    ),
    "each seed": (
        CLAIM + "of.backend = 'ekf'\nbelow = 1\neach = 'seed'\n",
        "line 20: claim.each: found 'seed', expected a parameter",
    ),
    "growth over words": (
        CLAIM + "of.loops = 1\ngrows = 'backend'\nbelow = 1\n",
        "line 19: claim.grows: found 'backend', expected a parameter whose values",
    ),
    "growth over what is held": (
        CLAIM + "of.loops = 1\ngrows = 'loops'\nbelow = 1\nwhere.backend = 'ekf'\n",
        "line 19: claim.grows: found 'loops', expected",
    ),
    "growth and each": (
        CLAIM + "of.backend = 'ekf'\ngrows = 'loops'\nbelow = 1\neach = 'loops'\n",
        "line 21: claim.each: found 'loops', expected another",
    ),
    "crossing over what is held": (
        CLAIM + "less.backend = 'ekf'\nthan.backend = 'fastslam'\ncrosses = 'loops'\nwhere = {loops=1,particles=10}\n",
        "line 20: claim.crosses: found 'loops', expected a parameter that is swept; loops is 1 in all of its cells.",
    ),
}  # fmt: skip

FIGURE_ERRORS = {
    "no x": ('[[figure]]\ny = "ate_m"\n', "line 15: figure has no 'x', expected a text."),
    "an unknown x": (
        '[[figure]]\nx = "lops"\ny = "ate_m"\n',
        "line 16: figure.x: no cell has a parameter 'lops'; did you mean",
    ),
    "an unknown y": (
        '[[figure]]\nx = "loops"\ny = "nes"\n',
        "line 17: figure.y: there is no column 'nes'; did you mean 'nees'?",
    ),
    "y a parameter": (
        '[[figure]]\nx = "loops"\ny = "landmarks"\n',
        "line 17: figure.y: landmarks is swept, so it is a parameter",
    ),
    "an unknown by": (
        '[[figure]]\nx = "loops"\ny = "nees"\nby = "who"\n',
        "line 18: figure.by: no cell has a parameter 'who'",
    ),
    "by x": (
        '[[figure]]\nx = "loops"\ny = "nees"\nby = "loops"\n',
        "line 18: figure.by: found 'loops', which is x, expected",
    ),
    "a single x": (
        '[[figure]]\nx = "loops"\ny = "nees"\nwhere = { loops = 2 }\n',
        "line 16: figure.x: found 'loops', expected a parameter that",
    ),
    "nothing to draw": (
        '[[figure]]\nx = "loops"\ny = "nees"\nwhere = { backend = "ekf", particles = 10 }\n',
        "line 18: figure.where: no cell has backend = 'ekf' and particles = 10 together, expected a selection",
    ),
    "no axis": (
        '[[figure]]\nx = "loops"\ny = "nees"\nlog = "z"\n',
        "line 18: figure.log: found 'z', expected one of '', 'x', 'y', 'xy'.",
    ),
    "words on a scale": (
        '[[figure]]\nx = "backend"\ny = "nees"\nlog = "x"\n',
        "line 16: figure.x: found 'backend', expected a parameter whose values",
    ),
    "an unknown key": (
        '[[figure]]\nx = "loops"\ny = "nees"\ncolour = 1\n',
        "line 18: figure.colour: there is no such key",
    ),
    "no table": ("figure = 3\n", "expected [[figure]] with x and y."),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_a_file_that_is_wrong(name: str) -> None:
    text, sentence = ERRORS[name]
    assert sentence in refusal(text)


@pytest.mark.parametrize("name", CELL_ERRORS)
def test_cells_that_are_wrong(name: str) -> None:
    text, sentence = CELL_ERRORS[name]
    assert sentence in refusal(BLOCK + text)


@pytest.mark.parametrize("name", LABEL_ERRORS)
def test_names_that_are_wrong(name: str) -> None:
    dataset, backend, sentence = LABEL_ERRORS[name]
    assert sentence in refusal(f"[[cells]]\ndataset = {dataset}\nbackend = {backend}\n")


@pytest.mark.parametrize("name", CLAIM_ERRORS)
def test_claims_that_are_wrong(name: str) -> None:
    text, sentence = CLAIM_ERRORS[name]
    assert sentence in refusal(HEAD + text)


@pytest.mark.parametrize("name", FIGURE_ERRORS)
def test_figures_that_are_wrong(name: str) -> None:
    text, sentence = FIGURE_ERRORS[name]
    head = HEAD
    if name == "y a parameter":
        head = head.replace('"dataset.loops" = [1, 2]\n\n', '"dataset.landmarks" = [5, 6]\n\n', 1)
    assert sentence in refusal(text + head if name == "no table" else head + text)


def test_sides_need_logs_in_common_and_an_option_set_once() -> None:
    text = """[[cells]]
dataset = "bailey"
backend = "ekf"
seeds = [1, 2]
[[cells]]
dataset = "bailey"
backend = "ukf"
seeds = [3]
"""
    claim = CLAIM + 'less.backend = "ekf"\nthan.backend = "ukf"\n'
    assert "line 13: claim.than: has no log in common with less, expected the same seeds" in refusal(text + claim)
    assert study(text.replace("[3]", "[3, 2]") + claim).claims
    sentence = "line 4: dataset.loops: 'bailey[loops=3]' has a value of it already, expected one or the other."
    assert sentence in refusal('[[cells]]\ndataset = "bailey[loops=3]"\nbackend = "ekf"\ngrid.dataset.loops = [1, 2]\n')


def test_a_log_scale_takes_numbers_above_0_alone() -> None:
    block = '[[cells]]\ndataset = "bailey"\nbackend = "ekf"\ngrid.backend.gate = [0, 0.5]\n'
    figure = '[[figure]]\nx = "gate"\ny = "nees"\nlog = "x"\n'
    assert "line 8: figure.log: found 'x', expected no x in it: gate is 0.0 in some cells." in refusal(block + figure)


def test_files_are_found_by_name_or_path_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "matlab-report" in packaged()
    assert read("matlab-report", full=False).name == "matlab-report"
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(HEAD)
    assert read("mine.toml", full=False).name == "mine"
    Path("marked.toml").write_bytes(b"\xef\xbb\xbf" + HEAD.replace("\n", "\r\n").encode())
    assert read("marked.toml", full=False).cells == read("mine.toml", full=False).cells
    Path("bad.toml").write_bytes(b"\xff")
    for which, sentence in {
        "matlab-reprt": "matlab-reprt: No such file or directory; expected a study file, or the name of a packaged one",
        "bad.toml": "bad.toml: it is no text in UTF-8; expected",
        ".": ".: Is a directory; expected",
    }.items():
        with pytest.raises(InputError, match="expected a study file") as caught:
            read(which, full=False)
        assert str(caught.value).startswith(sentence)


def test_every_packaged_study_is_right_in_both_sizes_and_the_reference_fits_a_terminal() -> None:
    for name in packaged():
        assert len(read(name, full=False).cells) <= len(read(name, full=True).cells)
    assert max(map(len, FORMAT.splitlines())) < 80
    for key in (
        "seeds",
        "first_seed",
        "grid",
        "zip",
        "list",
        "crosses",
        "alike",
        "keep",
        "oracle",
        "memory_mb",
        "timed",
        "note",
    ):
        assert key in FORMAT


KEYS = st.text(st.sampled_from("ab.\" '#[]=é\\"), min_size=1, max_size=4)
VALUES = st.recursive(
    st.none(), lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=3), max_leaves=12
)


@settings(max_examples=80, deadline=None)
@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_every_value_is_on_the_line_where_it_is_said_to_be(tree: dict[str, Any]) -> None:
    counter = itertools.count(10_000)
    numbered = _numbered(tree, counter)
    text = tomli_w.dumps(numbered, multiline_strings=True)
    rows, found = text.split("\n"), lines(text)
    leaves = dict(_leaves(tomllib.loads(text), ()))
    assert set(leaves) <= set(found)
    for place, value in leaves.items():
        assert value.strip() in "".join(rows[found[place] - 1 :][: 1 + 2 * ("\n" in value)])


def _numbered(value: Any, counter: "itertools.count[int]") -> Any:
    """With another text in the place of every None: some over two lines, some with what looks like TOML."""
    if isinstance(value, dict):
        return {key: _numbered(inner, counter) for key, inner in value.items()}
    if isinstance(value, list):
        return [_numbered(inner, counter) for inner in value]
    n = next(counter)
    return f"\n{n}" if n % 3 == 0 else f"{n} # ] = [" if n % 3 == 1 else f"{n}"


def _leaves(value: Any, place: Place) -> Generator[tuple[Place, str]]:
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(inner, (*place, key))
    else:
        yield place, value


@pytest.mark.parametrize(
    ("only", "expected"),
    [
        ([], 16),
        (["backend=ekf"], 4),
        (["backend=ekf,fastslam", "loops=1"], 6),
        (["backend=ekf", "backend=f*"], 12),
        (["backend=*"], 16),
        (["particles=10.0", "seed=1"], 2),
        (["backend = ekf , dead-reckoning"], 8),
        (["dataset=?ailey"], 16),
    ],
)
def test_a_choice_leaves_the_cells_that_are_meant(only: Sequence[str], expected: int) -> None:
    found = study(HEAD.replace("seeds = 3", "seeds = 2"))
    assert sum(map(choice(found, only), found.cells)) == expected


def test_a_comma_in_brackets_is_no_end_of_a_value() -> None:
    found = study('[[cells]]\ndataset = "bailey"\nbackend = ["ekf[gate=0.5,confirm=2]", "ekf[gate=0.9]"]\n')
    chosen = choice(found, ["backend=ekf[gate=0.5,confirm=2],ekf[gate=0.9]"])
    assert [chosen(cell) for cell in found.cells] == [True, True]
    assert [choice(found, ["backend=ekf[gate=0.9]"])(cell) for cell in found.cells] == [False, True]


@pytest.mark.parametrize(
    ("only", "sentence"),
    [
        (["ekf"], "--only ekf: expected NAME=VALUE, and NAME one of dataset, backend, seed, loops, particles."),
        (["loops="], "--only loops=: expected NAME=VALUE"),
        (["loops=,"], "--only loops=,: expected values separated by commas"),
        (["backend=["], "--only backend=[: expected values separated by commas, with every bracket and quote closed."),
        (["lops=1"], "--only lops=1: no cell has a parameter 'lops'; did you mean 'loops'?"),
        (["loops=3"], "--only loops=3: no cell has loops=3, expected one of 1, 2."),
        (["backend=isam2*"], "no cell has backend=isam2*, expected one of ekf, dead-reckoning, fastslam."),
        (["backend=ekf", "particles=10"], "--only backend=ekf --only particles=10: no cell has all of that, expected"),
    ],
)
def test_a_choice_of_nothing_says_what_there_is(only: Sequence[str], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        choice(study(HEAD), only)
    assert sentence in str(caught.value)
