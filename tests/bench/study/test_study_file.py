"""Study files: what they say becomes cells, and what is wrong with one is a sentence with its line."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from slamduel.bench.plan.spec import backend_variants, dataset_variants
from slamduel.bench.study.file import FORMAT, packaged, read, reread
from slamduel.bench.study.only import choice
from slamduel.core.errors import InputError
from study_text import HEAD, study

CLAIM = '[[claim]]\nsays = "x"\nmeasure = "ate_m"\n'
FIGURE = '[[figure]]\nx = "loops"\ny = "nees"\n'


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


def test_options_that_need_each_other_are_swept_together_and_refused_by_the_line_of_their_dataset() -> None:
    """`loops` goes with landmarks=false alone."""
    text = """
        [[cells]]
        dataset = "depth-room[landmarks=false]"
        backend = "graph"
        grid."dataset.loops" = [false, true]
    """
    found = study(text)
    assert [cell.parameters["loops"] for cell in found.cells] == [False, True]
    assert [cell.cell.dataset.options.landmarks for cell in found.cells] == [False, False]
    with pytest.raises(InputError, match=r"s\.toml, line 3: options landmarks and loops: found both true"):
        study(text.replace("[landmarks=false]", ""))


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
    "a = 1\nb = = 2": "s.toml, line 2: not valid TOML at column 5: Invalid value; expected a TOML file.",
    "titel = 1": "s.toml, line 1: titel: there is no such key; did you mean 'title'?",
    'title = "x"': "s.toml: the file has no 'cells', expected [[cells]] with a dataset and a backend.",
    "[cells]": "s.toml, line 1: cells: found an empty table, expected [[cells]] with a dataset",
    "seeds = 1\ntimeout_s = 12345678901234567890": "s.toml, line 2: found a whole number beyond 64 bits, expected",
    "memory_mb = true": "line 1: memory_mb: found true, expected a whole number, at least 1 and at most 1,000,000,000.",
    "figure = 3": "s.toml, line 1: figure: found 3, expected [[figure]] with x and y.",
    '[[cells]]\ndataset = "bailey"': "line 1: cells has no 'backend', expected a text or",
    "x = 1\nseeds = { quick = 3 }": "line 2: seeds: found quick, expected quick and full, each with",
    "seeds = { quick = 3, full = 4, huge = 5 }": "line 1: seeds: found quick and full and huge, expected",
}  # fmt: skip

BLOCK = '[[cells]]\ndataset = "bailey"\nbackend = ["ekf", "fastslam"]\n'
CELL_ERRORS = {
    "seeds = 0": "line 4: cells.seeds: found 0, expected a whole number, at least 1, or a list",
    "seeds = 2000000": "line 4: cells.seeds: found 2000000, expected at most as many",
    "seeds = 600000": "line 2: cells.dataset: with these there are 1,200,000 cells, expected",
    "seeds = true": "line 4: cells.seeds: found true, expected a whole number",
    "seeds = []": "line 4: cells.seeds: found [], expected a whole number",
    "seeds = [1, -1]": "line 4: cells.seeds: found [1, -1], expected a whole number",
    "seeds = [1, 2, 1]": "line 4: cells.seeds: found [1, 2, 1], expected each seed once.",
    "first_seed = -1": "line 4: cells.first_seed: found -1, expected a whole number, at",
    "first_seed = 9\nseeds = [1, 2]":
        "line 4: cells.first_seed: the seeds are a list, expected how many there are from that one on.",
    "gird = 1": "line 4: cells.gird: there is no such key; did you mean 'grid'?",
    "grid.loops = [1]": "line 4: 'loops': expected the name of an option, as in",
    "\n[cells.grid]\n'dataset.loops' = []": "line 6: dataset.loops: found [], expected a list of",
    "grid.dataset.loops = 3": "line 4: dataset.loops: found 3, expected a list of values, at least one.",
    "grid.dataset.loops = [1,\n 2,\n 1]": "line 6: dataset.loops: found 1 twice, expected every value",
    "grid.dataset.loops = [1, [2]]": "line 4: dataset.loops: found [2], expected a number, a text",
    "grid.dataset.loops = [2020-01-01]": "line 4: dataset.loops: found the time 2020-01-01, expected a number",
    "grid.dataset.lops = [1]": "line 4: dataset.lops: dataset bailey has no option 'lops'; did you",
    "grid.backend.particles = [1]":
        "has no option 'particles', expected it of every backend of the block; give fastslam a [[cells]] of its own.",
    "grid.dataset.loops = [\n  1,\n  0,\n]":
        "s.toml, line 6: dataset bailey: option loops=0 is out of range; expected a whole number from 1 to 50.",
    "list = [{ dataset.loops = 1.5 }]": "line 4: dataset bailey: option loops=1.5: found '1.5'",
    "\n[cells.zip]\ndataset.loops = [1, 2]\ndataset.landmarks = [3]":
        "line 5: cells.zip: found values in unequal numbers, 2 of dataset.loops, 1 of dataset.landmarks; expected",
    "list = []": "line 4: cells.list: found [], expected a list of tables, as in list = [{",
    "list = [3]": "line 4: cells.list: found [3], expected a list of tables",
    "list = [{}]": "line 4: cells.list: found [an empty table], expected a list of tables",
    "grid.dataset.loops = [1]\nzip.dataset.loops = [2]": "line 5: dataset.loops is swept here and on line 4, expected",
    "list = [{ dataset.loops = 1 }, { dataset.loops = 1 }]": "line 2: cells.dataset: bailey[loops=1] with ekf",
    '[[cells]]\ndataset = "bailey"\nbackend = "ekf"':
        "line 5: cells.dataset: bailey with ekf is a cell of line 2 already, expected every cell once in a study.",
}  # fmt: skip

LABEL_ERRORS = [
    ('"baily"', '"ekf"', "s.toml, line 2: dataset: there is no dataset 'baily'; did you mean 'bailey'?"),
    ('"bailey"', '[\n"ekf",\n"efk"]', "s.toml, line 5: backend: there is no backend 'efk'; did you mean"),
    ('"bailey[lop=1]"', '"ekf"', "s.toml, line 2: dataset bailey: there is no option 'lop'; did you mean"),
    ('"bailey"', '"ekf,ukf"', "line 3: backend: found 'ekf,ukf', expected one per text; several go in a list."),
    ('"bailey"', '"ekf[gate=1"', "s.toml, line 3: backend ekf[gate=1: expected every bracket and quote"),
    ('"bailey"', '["ekf", "ekf"]', "line 3: backend: found 'ekf' twice, expected once."),
    ('["bailey", "bailey[loops=2]"]', '"ekf"', "line 2: cells.dataset: bailey with ekf is a cell twice"),
]  # fmt: skip

CLAIM_ERRORS = {
    "": "line 15: claim has no 'less', expected what it is about: one of of, less and than",
    "les.loops = 1": "line 18: claim.les: there is no such key; did you mean 'less'?",
    "of.loops = 1\nfactor = 2": "line 19: claim.factor: there is no such key; expected one",
    "less.loops = 1": "line 15: claim has no 'than', expected the cells to compare with",
    "of.loops = 1": "line 15: claim has no 'above', expected above, below or within = [low, high].",
    "of.loops = 1\nwithin = [2, 1]": "line 19: claim.within: found [2, 1], expected two",
    "of = { loops = 1, measure = 1 }\nbelow = 1": "line 18: claim.of.measure: found 1, expected a text",
    "of.loops = 1\nabove = 2\nbelow = 1": "line 19: claim.above: found 2, expected less than",
    "of.loops = 1\nwithin = [1, 2]\nbelow = 1": "line 20: claim.below: is given beside within",
    "less.loops = 1\nthan.loops = 2\nfactor = 0": "line 20: claim.factor: found 0, expected a number",
    '[[claim]]\nsays = "x"\nmeasure = "ate"\nof.loops = 1\nbelow = 1':
        "line 17: claim.measure: there is no column 'ate'; did you mean 'ate_m'?",
    '[[claim]]\nsays = "x"\nmeasure = "status"\nof.loops = 1\nbelow = 1':
        "line 17: claim.measure: column status is not",
    "less = { loops = 1, measure = 'atem' }\nthan.loops = 2\nwhere.backend = 'ekf'":
        "line 18: claim.less.measure: there is no column 'atem'; did you mean 'ate_m'?",
    "of.lops = 1\nbelow = 1": "line 18: claim.of.lops: no cell has a parameter 'lops'; did",
    "of.loops = 3\nbelow = 1": "line 18: claim.of.loops: no cell has 3, expected one of 1, 2.",
    "of.loops = 1\nbelow = 1\n[claim.where]\nbackend = 'efk'":
        "line 21: claim.where.backend: no cell has 'efk', expected one of 'ekf', 'dead-reckoning', 'fastslam'.",
    "of = { backend = 'ekf', particles = 10 }\nbelow = 1\nwhere.loops = 1":
        "line 18: claim.of: no cell has backend = 'ekf' and particles = 10 together, expected a selection",
    "of.loops = 1\nbelow = 1\nwhere.loops = 1": "line 18: claim.of.loops: is in where as well, expected in one",
    "less.backend = 'ekf'\nthan.backend = 'ekf'\nwhere.loops = 1": "line 19: claim.than: found a table, expected other",
    "of.dataset.loops = 1\nbelow = 1": "line 18: claim.of.dataset: found a table, expected a value; a name",
    "of.loops = [1]\nbelow = 1": "line 18: claim.of.loops: found [1], expected a number, a text",
    "of.backend = 'ekf'\nbelow = 1": "line 18: claim.of: has cells with loops = 1, 2, expected one value, by its own",
    "grows = 'loops'\nbelow = 1": "line 16: claim.says: has cells with backend = 'ekf', 'dead-reckoning', 'fastslam'",
    "of.backend = 'ekf'\nbelow = 1\neach = 'lops'": "line 20: claim.each: no cell has a parameter",
    "of = { backend = 'ekf', loops = 2 }\nbelow = 1\neach = 'loops'":
        "line 20: claim.each: found 'loops', expected a parameter that is swept; loops is 2 in all of its cells.",
    "of = { backend = 'ekf', loops = 2 }\nbelow = 1\neach = 'particles'":
        "line 20: claim.each: found 'particles', expected",
    "of.backend = 'ekf'\nbelow = 1\neach = 'seed'": "line 20: claim.each: found 'seed', expected a parameter",
    "of.loops = 1\ngrows = 'backend'\nbelow = 1":
        "line 19: claim.grows: found 'backend', expected a parameter whose values",
    "of.loops = 1\ngrows = 'loops'\nbelow = 1\nwhere.backend = 'ekf'": "line 19: claim.grows: found 'loops', expected",
    "of.backend = 'ekf'\ngrows = 'loops'\nbelow = 1\neach = 'loops'":
        "line 21: claim.each: found 'loops', expected another",
    "less.backend = 'ekf'\nthan.backend = 'fastslam'\ncrosses = 'loops'\nwhere = {loops=1,particles=10}":
        "line 20: claim.crosses: found 'loops', expected a parameter that is swept; loops is 1 in all of its cells.",
}  # fmt: skip

FIGURE_ERRORS = {
    '[[figure]]\nx = "lops"\ny = "ate_m"': "line 16: figure.x: no cell has a parameter 'lops'; did you mean",
    '[[figure]]\nx = "loops"\ny = "nes"': "line 17: figure.y: there is no column 'nes'; did you mean 'nees'?",
    'by = "who"': "line 18: figure.by: no cell has a parameter 'who'",
    'by = "loops"': "line 18: figure.by: found 'loops', which is x, expected",
    "where = { loops = 2 }": "line 16: figure.x: found 'loops', expected a parameter that",
    'where = { backend = "ekf", particles = 10 }':
        "line 18: figure.where: no cell has backend = 'ekf' and particles = 10 together, expected a selection",
    'log = "z"': "line 18: figure.log: found 'z', expected one of '', 'x', 'y', 'xy'.",
    '[[figure]]\nx = "backend"\ny = "nees"\nlog = "x"':
        "line 16: figure.x: found 'backend', expected a parameter whose values",
    "colour = 1": "line 18: figure.colour: there is no such key",
    "printed.Them = 3": "line 18: figure.printed.Them: found 3, expected a table",
    '[[figure]]\nx = "backend"\ny = "nees"\nprinted.Them.ekf = "x"':
        "line 18: figure.printed.Them.ekf: found 'x', expected a number",
    '[[figure]]\nx = "backend"\ny = "nees"\nprinted.Them.efk = 1.0':
        "line 18: figure.printed.Them.efk: no cell of the figure has backend = 'efk', expected one that is drawn.",
    'printed.Them.1 = 1.0': "line 18: figure.printed.Them.1: loops has values that are no words, expected",
}  # fmt: skip


@pytest.mark.parametrize(("text", "sentence"), ERRORS.items())
def test_a_file_that_is_wrong(text: str, sentence: str) -> None:
    assert sentence in refusal(text)


@pytest.mark.parametrize(("text", "sentence"), CELL_ERRORS.items())
def test_cells_that_are_wrong(text: str, sentence: str) -> None:
    assert sentence in refusal(BLOCK + text)


@pytest.mark.parametrize(("dataset", "backend", "sentence"), LABEL_ERRORS)
def test_names_that_are_wrong(dataset: str, backend: str, sentence: str) -> None:
    assert sentence in refusal(f"[[cells]]\ndataset = {dataset}\nbackend = {backend}\n")


@pytest.mark.parametrize(("text", "sentence"), CLAIM_ERRORS.items())
def test_claims_that_are_wrong(text: str, sentence: str) -> None:
    assert sentence in refusal(HEAD + (text if text.startswith("[[") else CLAIM + text))


@pytest.mark.parametrize(("text", "sentence"), FIGURE_ERRORS.items())
def test_figures_that_are_wrong(text: str, sentence: str) -> None:
    assert sentence in refusal(HEAD + (text if text.startswith("[[") else FIGURE + text))


def test_what_is_swept_is_no_column_to_draw() -> None:
    head = HEAD.replace('"dataset.loops" = [1, 2]\n\n', '"dataset.landmarks" = [5, 6]\n\n', 1)
    sentence = "line 17: figure.y: landmarks is swept, so it is a parameter"
    assert sentence in refusal(head + FIGURE.replace("nees", "landmarks"))


def test_a_file_that_is_thousands_of_tables_deep() -> None:
    assert "s.toml: found tables or lists nested hundreds deep" in refusal(".".join("a" * 2000) + " = 1\n")


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
        "bad.toml": "bad.toml: it is not UTF-8 text; expected",
        ".": ".: Is a directory; expected",
    }.items():
        with pytest.raises(InputError, match="expected a study file") as caught:
            read(which, full=False)
        assert str(caught.value).startswith(sentence)


def test_every_packaged_study_is_right_in_both_sizes_and_the_reference_fits_a_terminal() -> None:
    for name in packaged():
        assert len(read(name, full=False).cells) <= len(read(name, full=True).cells)
    assert max(map(len, FORMAT.splitlines())) < 80
    keys = {"seeds", "first_seed", "grid", "zip", "list", "crosses", "alike", "keep", "oracle", "memory_mb", "timed"}
    assert keys <= set(FORMAT.split())


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
    found = study('[[cells]]\ndataset = "bailey"\nbackend = ["ekf[gate=0.5,gate_after=2]", "ekf[gate=0.9]"]\n')
    chosen = choice(found, ["backend=ekf[gate=0.5,gate_after=2],ekf[gate=0.9]"])
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
