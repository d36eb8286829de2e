"""A study's report says what its store has, no more; and the gallery what the reports say."""

import json
import re
import shutil
from html import unescape
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas
from matplotlib.image import imread

from command import refused
from slamduel.bench.claims.curves import MANY, medians, names
from slamduel.bench.cli import main as bench
from slamduel.bench.drawing.svg import PAPER
from slamduel.bench.record.cell_table import CellTable
from slamduel.bench.record.store import Store
from slamduel.bench.study.study import Figure
from slamduel.bench.study_report.evidence import evidence, option_words
from slamduel.bench.study_report.figure import span
from slamduel.bench.study_report.gallery import gallery, main
from slamduel.bench.study_report.line_looks import line_looks
from slamduel.bench.study_report.marks import Bound, Crossing, Marks, draw_across, marks
from slamduel.bench.study_report.report import again, write
from slamduel.bench.study_report.rows import draw_rows
from slamduel.bench.study_report.tables import median_grid
from slamduel.bench.verdict.statistics import estimate
from slamduel.bench.words.numerals import number
from slamduel.core.errors import InputError
from small_record import edited
from small_study import Outcome, small_study

TEXT = """
title = "Tags & tags"
question = "Are <b>many</b> tags better than few?"
source = "Report | one"
finding = "They are."
[[cells]]
dataset = "circle"
backend = ["ekf", "ukf"]
seeds = 8
grid."dataset.landmarks" = [6, 12, 24]
[[figure]]
x = "landmarks"
y = "ate_m"
log = "xy"
[[figure]]
x = "backend"
y = "nees"
where = { landmarks = 6 }
[[claim]]
says = "More are better"
measure = "ate_m"
less = { landmarks = 24 }
than = { landmarks = 6 }
where = { backend = "ekf" }
[[claim]]
says = "The EKF is consistent"
measure = "nees"
of = { backend = "ekf", landmarks = 6 }
below = 1.25
"""


def ate(backend: str, landmarks: int, seed: int) -> float:
    """Halves as landmarks double, spread over seeds."""
    return (1 + (backend == "ukf")) * 0.6 / landmarks * (1 + 0.01 * seed)


def outcomes(waiting: int = 0, failing: int = 0, nees: float = 1.0) -> list[Outcome]:
    """Those of all cells, the last seeds waiting; the first so many of the UKF's failed with 24 landmarks."""
    found: list[Outcome] = []
    for backend in ("ekf", "ukf"):
        for landmarks in (6, 12, 24):
            for seed in range(8):
                cell = {"dataset": "circle", "backend": backend, "seed": seed, "landmarks": landmarks}
                columns = {"ate_m": ate(backend, landmarks, seed), "nees": nees + 0.01 * seed}
                status = "waiting" if seed >= 8 - waiting else "done"
                if backend == "ukf" and landmarks == 24 and seed < failing:
                    status, columns = "diverged", {"reason": f"left at step {seed} <by far>"}
                found.append(Outcome(cell, status, columns))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_study(tmp_path_factory.mktemp("study") / "tags", "tags", TEXT, outcomes(failing=2))


@pytest.fixture(scope="module")
def page(folder: Path) -> Path:
    return write(folder, ("png",))


def said(path: Path) -> str:
    """What a reader sees of a page, in one line."""
    body = path.read_text(encoding="utf-8").partition("<body>")[2]
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", body)).split())


def parted(sentence: str, says: str) -> str:
    """As a page sets it: what is claimed, then what was measured."""
    return f"{says} {sentence.partition(f'{says}: ')[2]}"


def test_the_page_has_the_numbers_of_the_store(page: Path) -> None:
    text = said(page)
    for backend in ("ekf", "ukf"):
        for landmarks in (6, 12, 24):
            values = [ate(backend, landmarks, seed) for seed in range(8)]
            if (backend, landmarks) == ("ukf", 24):
                values[:2] = [np.inf] * 2
            found = estimate(values)
            assert f"{number(found.value)} {number(found.low)}\N{EN DASH}{number(found.high)}, n 8" in text
    markdown = page.with_name("report.md").read_text(encoding="utf-8")
    assert number(estimate([ate("ekf", 12, seed) for seed in range(8)]).value) in markdown


def test_a_finding_that_holds_is_reproduced_and_every_claim_has_its_interval(page: Path, folder: Path) -> None:
    text, found = said(page), evidence(folder)
    markdown = page.with_name("report.md").read_text(encoding="utf-8")
    assert "✓ Reproduced : all 2 claims hold." in text
    document = json.loads(page.with_name("answers.json").read_text())
    assert document["reproduced"] == "yes"
    assert document["cells"] == {"done": 46, "diverged": 2}
    for answer, written in zip(found.answers, document["claims"], strict=True):
        assert parted(answer.sentence, answer.claim.says) in text
        assert answer.sentence in unescape(markdown)
        assert written["estimate"] == pytest.approx(answer.figures["estimate"])
        ends = f"{number(answer.figures['low'])}\N{EN DASH}{number(answer.figures['high'])}"
        assert ends in text or answer.figures["low"] == answer.figures["high"]


def test_a_finding_that_does_not_hold_says_so_plainly(tmp_path: Path) -> None:
    folder = small_study(tmp_path / "s", "s", TEXT, outcomes(nees=3.0))
    text = said(write(folder, ()))
    assert "✗ Not reproduced" in text
    assert "✓ Reproduced" not in text
    assert json.loads((folder / "answers.json").read_text())["reproduced"] == "no"


def test_what_does_not_hold_is_told_first_where_there_is_little_room(tmp_path: Path) -> None:
    more = "".join(
        f'[[claim]]\nsays = "{k}"\nmeasure = "ate_m"\nof = {{ backend = "ekf", landmarks = 6 }}\nbelow = {k}.0\n'
        for k in range(1, 5)
    )
    found = evidence(small_study(tmp_path / "s", "s", TEXT + more, outcomes(nees=3.0)))
    assert [one.verdict for one in found.most_telling] == ["fails", "holds", "holds"]
    assert [one.says for one in found.most_telling] == ["The EKF is consistent", "More are better", "1"]
    assert found.answered == ("Not reproduced", "5 of 6 claims hold, 1 fails.")


def drawn(folder: Path, claim: str, figure: int = 0) -> Marks:
    """What the claim draws into a figure of the study."""
    found = evidence(small_study(folder, "s", f'{TEXT}[[claim]]\nsays = "so"\n{claim}', outcomes()))
    return marks(found.medians[figure], found.answers[2:])


def test_a_claim_draws_its_bound_where_it_is_claimed(tmp_path: Path) -> None:
    of = 'of = { backend = "ekf", landmarks = 12 }'
    assert drawn(tmp_path / "a", f'measure = "ate_m"\n{of}\nbelow = 0.1').bounds == (Bound(0.1, True, 12, "ekf"),)
    each = 'of = { backend = "ekf" }\neach = "landmarks"'
    assert drawn(tmp_path / "b", f'measure = "ate_m"\n{each}\nabove = 0.1').bounds == (Bound(0.1, False, None, "ekf"),)
    assert drawn(tmp_path / "c", f'measure = "nees"\n{of}\nabove = 0.1', figure=1) == Marks((), (), {})  # has 6 alone


def test_printed_values_stand_in_their_rows_and_tables(tmp_path: Path) -> None:
    where = "where = { landmarks = 6 }"
    text = TEXT.replace(where, f"{where}\nprinted.Them = {{ ekf = 3.25, ukf = 1.5 }}")
    found = evidence(small_study(tmp_path, "s", text, outcomes()))
    canvas = Canvas()
    draw_rows(canvas, found.medians[1], line_looks(found.medians[1], ["ekf", "ukf"]), Marks((), (), {}), "NEES")
    (axes,) = canvas.axes
    (line,) = [one for one in axes.lines if one.get_label() == "Them"]
    assert line.get_xydata() == pytest.approx(np.array([(3.25, 0.12), (1.5, 1.12)]))
    assert axes.get_xlim()[1] > 3.25
    (legend,) = canvas.legends
    assert [one.get_text() for one in legend.get_texts()] == ["measured here", "Them"]
    grid = median_grid(found.medians[1])
    assert grid.headings[-1] == "Them"
    assert [row[-1].text for row in grid.rows] == ["3.25", "1.50"]
    assert "Them" in (write(tmp_path).parent / "report.md").read_text()


def test_values_that_are_no_words_are_named_with_their_parameter() -> None:
    assert names("dataset.wheels_check", [False, True]) == {False: "wheels check no", True: "wheels check yes"}
    assert names("poses", [25, "all", None]) == {25: "poses 25", "all": "all", None: "poses \N{EN DASH}"}


def test_a_claim_at_a_printed_value_draws_no_bound_beside_it(tmp_path: Path) -> None:
    claims = '[[claim]]\nsays = "so"\nmeasure = "nees"\nof = { backend = "ekf", landmarks = 6 }\nbelow = '
    for bound, drawn_bounds in ((3.25, (1.25,)), (3.5, (1.25, 3.5))):
        text = TEXT.replace("where = { landmarks = 6 }", "where = { landmarks = 6 }\nprinted.Them = { ekf = 3.25 }")
        found = evidence(small_study(tmp_path / str(bound), "s", f"{text}{claims}{bound}", outcomes()))
        assert tuple(one.value for one in marks(found.medians[1], found.answers).bounds) == drawn_bounds


def test_a_power_is_written_beside_its_line(tmp_path: Path) -> None:
    found = drawn(tmp_path / "a", 'measure = "ate_m"\nof = { backend = "ekf" }\ngrows = "landmarks"\nbelow = 0.0')
    assert found.slopes == {"ekf": pytest.approx(-1)}
    write(tmp_path / "a")
    assert "slope -1.00" in (tmp_path / "a" / "figures" / "s-1.svg").read_text(encoding="utf-8")


def test_in_print_words_stand_on_white(tmp_path: Path) -> None:
    """Not on the colour that only a page replaces by its own."""
    claim = 'measure = "ate_m"\nof = { backend = "ekf", landmarks = 12 }\nbelow = 0.1'
    drawn(tmp_path / "a", claim)
    found = evidence(tmp_path / "a").figures[0]
    assert "claimed: below 0.1" in found.svg
    assert PAPER in found.svg
    assert found.printed is not None
    pixels = imread(BytesIO(found.printed("png")))[..., :3]
    paper = [int(PAPER[k : k + 2], 16) for k in (1, 3, 5)]
    assert (np.round(255 * pixels) == paper).all(axis=-1).sum() < 100  # edges of letters; the words' ground has 10,000


def test_where_lines_cross_it_says_whose_is_less(tmp_path: Path) -> None:
    """The UKF's error is twice the EKF's, then falls with the cube of the landmarks instead of in proportion."""
    crossing = 'measure = "ate_m"\nless = { backend = "ukf" }\nthan = { backend = "ekf" }\ncrosses = "landmarks"'
    text = f'{TEXT}[[claim]]\nsays = "so"\n{crossing}'
    steeper = [
        one._replace(columns={**one.columns, "ate_m": one.columns["ate_m"] * (12 / one.parameters["landmarks"]) ** 2})
        if one.parameters["backend"] == "ukf" else one
        for one in outcomes()
    ]  # fmt: skip
    found = evidence(small_study(tmp_path / "s", "s", text, steeper))
    (one,) = marks(found.medians[0], found.answers).crossings
    assert one.value == pytest.approx(12 * 2**0.5, rel=1e-6)  # there 2 (12 / x)^2 is 1
    write(tmp_path / "s")
    svg = (tmp_path / "s" / "figures" / "s-1.svg").read_text(encoding="utf-8")
    assert "ukf is less" in svg
    assert "from 17.0 on" in svg


def test_words_of_two_crossings_do_not_cover_each_other(tmp_path: Path) -> None:
    found = evidence(small_study(tmp_path / "s", "s", TEXT, outcomes())).medians[0]
    canvas = Canvas(figsize=(4, 3))
    axes = canvas.subplots()
    axes.set_xlim(0, 100)
    near = [Crossing(at, at - 5, at + 5, f"isam2 is less\nfrom {at} on") for at in (50.0, 62.0)]
    draw_across(axes, found, Marks((), near, {}))
    canvas.draw_without_rendering()
    one, other = (text.get_window_extent() for text in axes.texts)
    assert not one.overlaps(other)


def test_one_wild_interval_leaves_the_medians_their_room(tmp_path: Path) -> None:
    """Of 8 runs one end of the interval is among the wild ones: it may not push the medians out of the picture."""
    wild = [
        one._replace(columns={**one.columns, "ate_m": 1e9}) if one.parameters["seed"] >= 5 else one
        for one in outcomes()
    ]
    found = evidence(small_study(tmp_path / "s", "s", TEXT, wild))
    places = found.medians[0].places.values()
    low, high, log = span(found.medians[0], marks(found.medians[0], found.answers))
    assert log
    assert all(low <= place.value <= high for place in places)
    assert max(place.high for place in places) > high
    values = np.log10([place.value for place in places])
    assert np.ptp(values) > np.log10(high / low) / 3


@pytest.mark.parametrize(
    ("option", "dataset", "label"),
    [
        ("tags", "matlab-report", "number of tags"),
        ("loops", "bailey", "laps of the loop (loops)"),
        ("wrong_ids", "circle", "share of sightings with another landmark's id (wrong ids)"),
    ],
)
def test_an_axis_is_called_what_its_option_is(option: str, dataset: str, label: str) -> None:
    table = CellTable({"dataset": np.array([dataset], object), "backend": np.array(["ekf"], object),
                        option: np.array([1], object)})  # fmt: skip
    assert option_words(option, table) == label


def test_names_of_datasets_leave_out_what_all_of_them_say() -> None:
    assert names("dataset", ["a[b=1]", "a[b=1,c=2]"]) == {"a[b=1]": "a", "a[b=1,c=2]": "a[c=2]"}
    files = ["csv[odometry=x/d1/o.csv,detections=x/d1/s.csv]", "csv[name=k,odometry=x/d2/o.csv]"]
    assert list(names("dataset", files).values()) == ["d1", "k"]


def test_failures_are_grouped_with_their_reason_and_place(page: Path) -> None:
    text = said(page)
    assert "2 of 48 cells failed" in text
    assert "diverged , 2 cells: left at step 0 <by far>" in text
    assert "backend ukf; seed 0, 1; landmarks 24" in text
    assert "46 done, 2 diverged" in text
    assert "2 of 48, counted as the worst there is" in text


def test_half_a_study_says_how_far_it_is(tmp_path: Path) -> None:
    text = said(write(small_study(tmp_path / "s", "s", TEXT, outcomes(waiting=3)), ()))
    assert "18 of 48 cells have not run" in text
    assert "? Not decided yet" in text
    assert "n 5, 3 waiting" in text


def test_a_study_of_which_nothing_has_run_has_a_page(tmp_path: Path) -> None:
    text = said(write(small_study(tmp_path / "s", "s", TEXT, outcomes(waiting=8)), ()))
    assert "48 of 48 cells have not run" in text
    assert "nan" not in text.lower().split()


def test_what_people_wrote_is_text(page: Path) -> None:
    html = page.read_text(encoding="utf-8")
    assert "<b>many</b>" not in html
    assert "Are &lt;b&gt;many&lt;/b&gt; tags better than few?" in html
    assert "Report \\| one" in page.with_name("report.md").read_text(encoding="utf-8")


def test_figures_are_files(page: Path) -> None:
    assert {path.name for path in (page.parent / "figures").iterdir()} == {
        f"tags-{k}.{form}" for k in (1, 2) for form in ("svg", "png")
    }


def test_no_study_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected the folder of a run or a study"):
        write(tmp_path)


def test_a_median_keeps_its_places() -> None:
    """By x and by, each with the cells that are its own; a large group's interval is the exact one's, nearly."""
    rng = np.random.default_rng(1)
    n = 4 * (MANY + 1)
    values = rng.lognormal(size=n)
    columns: dict[str, Any] = {
        "backend": np.array(["a", "b"] * (n // 2), object),
        "noise": np.array([0.2, 0.2, 0.1, 0.1] * (n // 4), object),
        "status": np.array(["done"] * n, object),
        "ate_m": values,
    }
    found = medians(Figure("noise", "ate_m", "backend", {}, "", "", ""), CellTable(columns))
    assert list(found.xs) == [0.1, 0.2]
    for k, key in enumerate([(0.2, "a"), (0.2, "b"), (0.1, "a"), (0.1, "b")]):
        exact, place = estimate(values[k::4].tolist()), found.places[key]
        assert place.n == MANY + 1
        assert place.value == pytest.approx(exact.value)
        own = np.sort(values[k::4])
        for end, other in ((place.low, exact.low), (place.high, exact.high)):
            assert abs(np.searchsorted(own, end) - np.searchsorted(own, other)) <= 2


def test_the_gallery_counts_findings_and_leads_to_reports(page: Path, tmp_path: Path) -> None:
    root = tmp_path / "gallery"
    shutil.copytree(page.parent, root / "tags")
    small_study(root / "wrong", "wrong", TEXT, outcomes(nees=3.0))
    assert main([str(root)]) == 0
    index = root / "index.html"
    text = said(index)
    assert "1 of 2 published findings reproduced, 1 not" in text
    claims = [answer.verdict for name in ("tags", "wrong") for answer in evidence(root / name).answers]
    assert f"{claims.count('holds')} of {len(claims)} claims hold" in text
    assert text.index("Not reproduced") < text.index("Reproduced")
    assert 'href="tags/report.html"' in index.read_text(encoding="utf-8")
    first = evidence(root / "tags").answers[0]
    assert parted(first.sentence, first.claim.says) in text
    (root / "broken").mkdir()
    (root / "broken" / "results.sqlite").write_text("no database")
    assert main([str(root)]) == 0
    assert "broken/results.sqlite" in said(index)


def test_what_goes_on_is_the_whole_study(page: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(page.parent, tmp_path / "tags")
    typed = "bench ablate tags.toml --only backend=ekf --out tags --limit=3 --retry --limit 4"
    with Store(folder, writing=True) as store:
        store.put_about({"command": typed.split()})
    lines = set(again(evidence(folder)).values())
    assert lines <= {f"bench ablate tags.toml --out tags{more}" for more in ("", " --retry", " --full")}
    assert "bench ablate tags.toml --out tags" in lines


def test_a_gallery_of_nothing_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path)]) == 2
    assert "found no study" in capsys.readouterr().err


@pytest.mark.slow
def test_pages_fit_are_quiet_and_ask_for_nothing(browser: Any, page: Path) -> None:
    index = gallery([page.parent], page.parent / "index.html")
    for path in (page, index):
        for width in (1400, 400):
            shown = browser.new_page(viewport={"width": width, "height": 900}, color_scheme="dark")
            heard: list[str] = []
            asked: list[str] = []
            shown.on("console", lambda message, heard=heard: heard.append(message.text))
            shown.on("request", lambda request, asked=asked: asked.append(request.url))
            shown.goto(path.as_uri())
            assert shown.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
            shown.evaluate("for (const fold of document.querySelectorAll('details')) fold.open = true")
            assert shown.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
            assert (heard, asked) == ([], [path.as_uri()])
            assert shown.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
            shown.close()


def test_the_command_writes_it_again_and_others_read_it_as_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = small_study(tmp_path / "again", "again", TEXT, outcomes())
    assert bench(["report", str(folder), "--figures", "png"]) == 0
    assert capsys.readouterr().out == f"report: {folder / 'report.html'}\n"
    assert len(list((folder / "figures").glob("*.png"))) == len(evidence(folder).study.figures)
    assert bench(["compare", str(folder), str(folder)]) == 0
    assert "the same to the last bit" in capsys.readouterr().out


def test_no_estimate_where_it_could_not_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = small_study(tmp_path / "another", "another", TEXT, outcomes())
    (tmp_path / "file").touch()
    for place, sentence in ((folder, "holds the study another, expected"), (tmp_path / "file", "is no folder")):
        said = refused(capsys, "ablate", "matlab-report", "--dry-run", "--out", place)
        assert f"--out {place}: {sentence}" in said


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        ("DELETE FROM about WHERE name = 'size'", "has no size of the study yet; expected one that was begun"),
        ("UPDATE about SET value = '{' WHERE name = 'size'", "expected the record of a run or a study, whole"),
        ("UPDATE plan SET parameters = '{' WHERE place = 0", "expected the record of a run or a study, whole"),
        ("UPDATE results SET ate_m = 'x' WHERE key = 'key 0'", "expected the record of a run or a study, whole"),
    ],
)
def test_a_store_that_makes_no_sense_is_a_sentence(
    tmp_path: Path, spoil: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = small_study(tmp_path / "s", "s", TEXT, outcomes())
    edited(folder, spoil)
    assert sentence in refused(capsys, "report", folder)
    assert not (folder / "report.html").exists()
