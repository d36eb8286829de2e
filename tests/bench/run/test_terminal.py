"""What a run looks like: in a terminal of any width, in a pipe, in JSON, and while it goes on."""

import io
import json
import math
import os
import pty
import re
import subprocess
import sys
import threading
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from slamduel.bench.cli import main
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.work import PlannedCell, work_of
from slamduel.bench.record.schema import COLUMNS, MORE, Row
from slamduel.bench.run import progress
from slamduel.bench.run.benchmark import DEFAULTS
from slamduel.bench.run.cell_remarks import cell_remarks
from slamduel.bench.run.document import document
from slamduel.bench.run.progress import Pace, Screen
from slamduel.bench.run.terminal import NONE, complain, conclude, status, tables, verdicts
from slamduel.bench.verdict.statistics import FEWEST
from slamduel.bench.verdict.summary import Line, lines
from slamduel.bench.words.ascii import PLAIN, plain_where_needed
from slamduel.bench.words.console import screen_console, watched, wrapped
from slamduel.bench.words.names import called
from slamduel.bench.words.stages import time_left

LONG = "fastslam[particles=1000,version=2]"
ESCAPE = "\x1b"


def row(backend: str, seed: int = 0, ended: str = "done", dataset: str = "room", **columns: Any) -> dict[str, Any]:
    """A cell of a known path, with an error that grows with the seed."""
    name, _, options = backend.rstrip("]").partition("[")
    place, _, given = dataset.removesuffix("]").partition("[")
    values = {"dataset": place, "dataset_options": given, "backend": name, "options": options, "seed": seed}
    values |= {"status": ended, "reason": "", "digest": f"{dataset} {seed}", "truth_kind": "truth", "timing_alone": 1}
    if ended == "done":
        values |= {"ate_m": 0.1 + 0.01 * seed, "nees": 1.0, "nees_inside": 0.95, "sightings": 9, "cpu_s": 0.5}
        values |= {"step_us_p50": 12.0, "step_us_p99": 40.0}
    return dict.fromkeys((*COLUMNS, *MORE)) | values | columns


def run(*rows: dict[str, Any]) -> list[Line]:
    return lines(Row(columns, "") for columns in rows)


def made_by(found: list[Line], **kinds: str) -> list[Line]:
    """The lines as those of a run that says whose programs its backends are."""
    return [line._replace(implementation=kinds.get(line.backend.partition("[")[0], "")) for line in found]


def many(seeds: int, *backends: str) -> list[Line]:
    return run(*(row(backend, seed) for backend in backends for seed in range(seeds)))


def printed(found: list[Line], width: int, *, terminal: bool = True, remarks: Any = NONE) -> str:
    """What is printed on a console of that width, without styles."""
    file = Watched() if terminal else io.StringIO()
    console = Console(width=width, file=file, force_terminal=terminal, no_color=True, color_system=None)
    conclude(console, found, remarks)
    return console.file.getvalue()  # pyright: ignore[reportAttributeAccessIssue]


def headings(found: list[Line], width: int) -> list[list[str]]:
    return [[str(column.header) for column in table.columns] for table in tables(found, width)]


@pytest.mark.parametrize("terminal", [True, False])
def test_remarks_on_the_logs_are_told_with_their_results(terminal: bool) -> None:
    said = printed(many(2, "ekf"), 100, terminal=terminal, remarks={"room": ["no reading for 5 s"], "park": ["none"]})
    assert " ".join(said.split()).endswith("remark no reading for 5 s")


@pytest.mark.parametrize("width", [40, 60, 80, 100, 140])
def test_no_line_is_wider_than_the_terminal_and_no_name_is_broken(width: int) -> None:
    said = printed(many(FEWEST, "dead-reckoning", "ekf", LONG), width)
    assert max(map(len, said.splitlines())) <= width
    table = said.partition("online")[0]
    assert table.count("0.125") == table.count("1.00") == 3  # a number is never cut
    for piece in ("fastslam[", "particles=1000,", "version=2]", "dead-reckoning") if width >= 60 else ():
        assert any(piece in line for line in said.splitlines())


def test_what_there_is_no_room_for_goes_and_errors_stay() -> None:
    found = many(FEWEST, "ekf", LONG)
    assert headings(found, 160)[0] == [
        "backend",
        "done",
        "ATE, m",
        "final, m",
        "NEES / 3",
        "in 95 %",
        "step, µs",
        "p99",
    ]
    shown = [headings(found, width)[0] for width in (160, 80, 60, 40)]
    assert all(len(wide) >= len(narrow) for wide, narrow in pairwise(shown))
    assert {"backend", "ATE, m", "final, m", "NEES / 3"} <= set(shown[-1])
    assert "p99" not in shown[1]


def test_done_stays_where_not_everything_is() -> None:
    found = run(*(row("ekf", seed) for seed in range(5)), row("ekf", 5, "diverged", reason="lost"))
    assert all("done" in headings(found, width)[0] for width in (60, 80, 160))
    assert "5/6" in printed(found, 80)
    assert "diverged     ekf, 1 of 6: lost" in printed(found, 80)


def test_intervals_need_six_logs() -> None:
    assert "6 logs; medians (95 % intervals)" in printed(many(6, "ekf"), 120)
    assert "0.125 (0.104-0.146)" in printed(many(6, "ekf"), 120)
    assert "5 logs; medians (ranges)" in printed(many(5, "ekf"), 120)
    assert "0.120 (0.100-0.140)" in printed(many(5, "ekf"), 120)
    repeats = run(*(row("ekf", seed, digest="same") for seed in range(8)))
    assert "1 log; medians (ranges)" in printed(repeats, 120)


def test_a_failure_reaches_into_the_interval() -> None:
    found = run(*(row("ekf", seed) for seed in range(5)), row("ekf", 5, "error", reason="x"))
    assert "0.125 (0.104-inf)" in printed(found, 120)


def test_the_verdict_names_what_to_use_in_a_few_lines() -> None:
    found = many(8, "ekf") + run(*(row("isam2", seed, ate_m=1.0 + seed) for seed in range(8)))
    said = printed(found, 100)
    assert re.search(r"^  online +ekf: ", said, re.MULTILINE)
    assert len(said.splitlines()) < 15
    (use,) = verdicts(found)["room"].uses
    assert use.why.rstrip(".") in " ".join(printed(found, 100, terminal=False).split())


def test_whose_programs_the_costs_are_of_is_told_where_they_are_of_several() -> None:
    found = many(6, "ekf", LONG, "isam2")
    both = made_by(found, ekf="compiled here", fastslam="compiled here", isam2="GTSAM's wheel")
    said = "GTSAM's wheel: isam2; compiled here: the others. Costs compare implementations, not algorithms alone."
    assert f"  costs        {said}" in printed(both, 120, terminal=False)
    assert all(len(line.rstrip()) <= 80 for line in printed(both, 80).splitlines())
    for one in (found, made_by(found, ekf="compiled here", fastslam="compiled here", isam2="compiled here")):
        assert "Costs compare" not in printed(one, 120, terminal=False)
        assert "  costs        Each cell was timed once" in printed(one, 120, terminal=False)


def test_a_run_of_nothing_but_skipped_cells_says_so_and_is_no_success() -> None:
    found = run(*(row(backend, seed, "skipped", reason="loops") for backend in ("ekf", "ukf") for seed in range(2)))
    assert "4 cells, all skipped: there is nothing to compare" in printed(found, 100)
    assert "ekf, 2 of 2: loops" in printed(found, 100)
    assert status(found) == 1
    assert status(found + run(row("isam2"))) == 0
    assert status(found + run(row("isam2"), row("isam2", 1, "timeout"))) == 1


def test_failures_go_to_standard_error_where_nothing_else_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    complain(
        run(row("ekf"), row("ekf", 1, "diverged", reason="[NaN] in 3"), row("ukf", ended="skipped", reason="loops"))
    )
    said = capsys.readouterr()
    assert not said.out
    assert said.err == "bench: room: diverged: ekf, 1 of 2: [NaN] in 3\nbench: room: skipped: ukf, 1 of 1: loops\n"


@pytest.mark.usefixtures("no_report")
def test_a_quiet_command_says_why_it_failed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--dataset", "circle[steps=30]", "--seeds", "1", "--backend"]
    assert main(["run", *words, "ekf", "--quiet", "--out", str(tmp_path / "done")]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["run", *words, "ekf[association=nn]", "--quiet", "--out", str(tmp_path / "skipped")]) == 1
    said = capsys.readouterr()
    assert not said.out
    assert said.err.startswith("bench: circle[steps=30]: nothing run: 1 cell, all skipped: there")


@pytest.mark.parametrize("width", [12, 20, 30, 80])
def test_labels_are_wrapped_after_commas_and_brackets(width: int) -> None:
    parts = wrapped(LONG, width).split("\n ")
    assert "".join(parts) == LONG
    assert all(part[-1] in "[," for part in parts[:-1])
    assert (len(parts) == 1) == (width >= len(LONG))


def test_datasets_are_called_by_the_least_that_tells_them_apart() -> None:
    assert called(["log[path=runs/logs/kitchen]", "circle"]) == {
        "log[path=runs/logs/kitchen]": "kitchen",
        "circle": "circle",
    }
    assert list(called(["log[path=a/x]", "log[path=b/x]"]).values()) == ["a/x", "b/x"]
    assert list(called(["log[path=/a/circle]", "circle"]).values()) == ["a/circle", "circle"]
    same = ["log[path=x]", "recording[path=x]"]
    assert list(called(same).values()) == same
    assert list(called(['log[path="a/x,y",noise=2]', "victoria-park[x=1]"]).values()) == [
        "x,y[noise=2]",
        "victoria-park[x=1]",
    ]


def test_time_left_is_by_dataset_and_backend() -> None:
    kinds = [(d, b) for d in ("short", "long") for b in ("ekf", "graph") for _ in range(3)]
    pace = Pace(kinds, 1)
    assert pace.left() is None
    pace.took(("short", "ekf"), 1.0)
    assert pace.left() == pytest.approx(11.0)  # nothing else is known
    pace.took(("short", "graph"), 10.0)
    pace.took(("long", "ekf"), 4.0)
    left = pace.left()
    alike = 2 * 1.0 + 2 * 10.0 + 2 * 4.0
    assert left == pytest.approx(alike + 3 * 40.0)  # as graph is to ekf on short, so on long
    pace.took(("long", "graph"), 40.0)
    assert pace.left() == pytest.approx(alike + 2 * 40.0)
    side_by_side = Pace([("a", "x"), ("a", "x"), ("b", "y")], 2)
    side_by_side.took(("a", "x"), 30.0)
    side_by_side.took(("a", "x"), 30.0)
    assert side_by_side.left() == pytest.approx(30.0)  # the last one is not shared


def test_time_left_neither_runs_out_nor_jumps_while_a_cell_is_late() -> None:
    pace = Pace([("city", "ekf")] * 5, 1)
    pace.took(("city", "ekf"), 100.0)
    left = [pace.left(since) or 0.0 for since in range(600)]
    assert left[0] == pytest.approx(400.0)
    assert left[60] == pytest.approx(340.0)
    assert min(left) == pytest.approx(300.0)  # the other cells still take as long
    assert max(abs(b - a) for a, b in pairwise(left)) <= 1.0 + 1e-9
    assert left[500] == pytest.approx(400.0)  # 400 s late: perhaps another 100
    pace.took(("city", "ekf"), 500.0)
    last = Pace([("city", "ekf")] * 2, 4)
    last.took(("city", "ekf"), 10.0)
    assert time_left(last.left(0.0) or 0.0) == "about 10 s left"
    assert time_left(last.left(300.0) or 0.0) == "about 70 s left"  # not "some seconds"


def test_a_run_without_a_terminal_tells_of_a_long_cell_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "AGAIN_S", 0.01)
    heard = threading.Event()

    class Heard(io.StringIO):
        def write(self, text: str) -> int:
            heard.set()
            return super().write(text)

    console = Console(file=(file := Heard()), width=100)
    with Screen(console) as screen:
        screen.running(plan(2), 0, 1, ())
        assert heard.wait(60)
    assert file.getvalue().startswith("0 of 8 done after 0:")


def test_a_time_is_told_no_finer_than_it_is_known() -> None:
    told = [time_left(seconds) for seconds in (0, 9, 44, 300, 9000)]
    assert told == ["some seconds left"] * 2 + ["about 40 s left", "about 5 min left", "about 2.5 h left"]


def plan(seeds: int = 2) -> Sequence[PlannedCell]:
    words = DEFAULTS | {"backend": "ekf,ukf", "dataset": "circle,bailey", "seeds": seeds}
    return work_of(Plan.from_words(words)).cells


def watch(console: Console, cells: Sequence[PlannedCell], **columns: Any) -> None:
    with Screen(console) as screen:
        screen.looking(1)
        screen.looked("a log")
        screen.running(cells, 0, 1, [])
        for cell in cells:
            key = dict(zip(("dataset", "dataset_options", "backend", "options", "seed"), cell.cell.key, strict=True))
            screen.finished(cell, row("ekf") | key | columns, 60.0)
        screen.reporting()


def test_in_a_pipe_a_cell_is_a_plain_line() -> None:
    console = Console(file=io.StringIO(), width=160)
    cells = plan()
    watch(console, cells)
    said = console.file.getvalue().splitlines()  # pyright: ignore[reportAttributeAccessIssue]
    assert len(said) == len(cells) == 8
    assert said[2].startswith(f"3 of 8 done {cells[2].cell.dataset.label} · {cells[2].cell.backend.label} · seed ")
    assert ESCAPE not in "".join(said)


def test_a_cell_that_was_stopped_is_a_line_though_nothing_of_it_is_known() -> None:
    console, cells = Console(file=io.StringIO(), width=160), plan(1)
    with Screen(console) as screen:
        screen.running(cells, 0, 1, [])
        for cell in cells:
            screen.finished(cell, {"status": "timeout", "reason": "was stopped after 2 s"}, 2.0)
    said = console.file.getvalue().splitlines()  # pyright: ignore[reportAttributeAccessIssue]
    assert [line.endswith("seed 0: was stopped after 2 s") for line in said] == [True] * 4


def test_a_remark_is_printed_once_a_log_and_a_final_error_is_called_so() -> None:
    console, cells = Console(file=io.StringIO(), width=160), plan(2)
    with Screen(console) as screen:
        screen.running(cells, 0, 1, [])
        for cell in cells:
            mine = {"truth_kind": "truth", "status": "done", "reason": f"all odd; {cell.cell.backend.label} alone"}
            mine |= {"final_ate_m": 0.25, "ate_m": None if cell.cell.backend == cells[0].cell.backend else 0.5}
            screen.finished(cell, mine, 1.0)
    said = console.file.getvalue().splitlines()  # pyright: ignore[reportAttributeAccessIssue]
    logs = {(cell.cell.dataset.label, cell.cell.seed) for cell in cells}
    assert sum("all odd" in line for line in said) == len(logs) < len(cells)
    for cell, line in zip(cells, said, strict=True):
        assert f"{cell.cell.backend.label} alone" in line
        first = cell.cell.backend == cells[0].cell.backend
        assert (" final ATE 0.250 m" in line) == first
        assert (" \N{MIDDLE DOT} ATE 0.500 m" in line) != first


def test_in_a_pipe_the_time_left_is_told_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(0, 10_000, 20))
    monkeypatch.setattr("slamduel.bench.run.progress.time.monotonic", lambda: float(next(now)))
    console = Console(file=io.StringIO(), width=160)
    watch(console, plan(20))
    said = console.file.getvalue().splitlines()  # pyright: ignore[reportAttributeAccessIssue]
    told = [line for line in said if " left" in line]
    assert 2 < len(told) < len(said)
    assert re.search(r"; about \d+ min left$", told[0])
    assert " left" not in said[-1]


class Watched(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("width", "height"), [(100, 40), (60, 12), (60, 4)])
def test_what_is_on_a_terminal_never_scrolls(width: int, height: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each frame fits, the tallest form that does: tables, a line a dataset, or the line at the foot alone."""
    console = Console(file=Watched(), width=width, height=height, force_terminal=True)
    heights: list[int] = []
    real = Screen.finished

    def finished(self: Screen, *words: Any) -> None:
        real(self, *words)
        frame = console.render_lines(self._renderable(), pad=False)  # pyright: ignore[reportPrivateUsage]
        heights.append(len(frame))
        assert all(sum(piece.cell_length for piece in line) <= width for line in frame)

    monkeypatch.setattr(Screen, "finished", finished)
    watch(console, plan())
    assert max(heights) < height
    assert (max(heights) > 14) == (height == 40)
    assert (max(heights) == 1) == (height == 4)


def test_on_a_terminal_only_news_are_lines_and_each_once() -> None:
    console = Console(file=Watched(), width=100, height=40, force_terminal=True, color_system=None)
    watch(console, plan(), status="diverged", reason="it was lost")
    said = console.file.getvalue()  # pyright: ignore[reportAttributeAccessIssue]
    assert said.count("it was lost") == 2  # a backend
    quiet = Console(file=Watched(), width=100, height=40, force_terminal=True, color_system=None)
    watch(quiet, plan())
    assert "seed" not in quiet.file.getvalue()  # pyright: ignore[reportAttributeAccessIssue]


def test_colours_and_controls_are_for_terminals_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TERM", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    assert not watched(screen_console(quiet=False))
    monkeypatch.setenv("FORCE_COLOR", "1")
    forced = screen_console(quiet=False)
    assert forced.is_terminal  # so that there are colours
    assert not watched(forced)  # and nothing is written over
    assert screen_console(quiet=True).quiet
    assert screen_console(quiet=False, aside=True).stderr
    monkeypatch.setenv("TERM", "dumb")
    assert not watched(Console(file=Watched()))
    monkeypatch.setenv("TERM", "xterm")
    assert watched(Console(file=Watched()))
    assert Console(file=Watched()).color_system is not None
    monkeypatch.setenv("NO_COLOR", "1")
    assert Console(file=Watched()).no_color


def test_letters_that_are_not_there_have_plain_ones() -> None:
    plain_where_needed()
    said = "ekf · 3 \N{MULTIPLICATION SIGN} 10⁷ ± 2 µs \N{EN DASH} naïve … ∞ 漢"
    assert said.encode("ascii", "slamduel-plain") == b"ekf | 3 x 107 +- 2 us - naive ... inf ?"
    assert said.encode("utf-8", "slamduel-plain").decode() == said
    assert all(text.isascii() for text in PLAIN.values())


def test_the_document_is_valid_json_and_says_what_the_tables_do() -> None:
    found = many(8, "ekf") + run(*(row("isam2", seed, "error", reason="x") for seed in range(8)))
    told = json.loads(json.dumps(document("r", "r/report.html", 1, found, verdicts(found), "", {}), allow_nan=False))
    assert set(told) == {"folder", "report", "status", "datasets", "cells", "remarks"}
    assert len(told["cells"]) == 16
    assert set(told["cells"][0]) == {*COLUMNS, *MORE}
    (dataset,) = told["datasets"]
    assert (dataset["dataset"], dataset["logs"], dataset["truth_kind"]) == ("room", 8, "truth")
    ekf, isam2 = dataset["lines"]
    assert ekf["estimates"]["ate_m"]["value"] == pytest.approx(0.135)
    assert ekf["estimates"]["nees"]["n"] == 8
    assert isam2["estimates"] == {}
    assert set(dataset["verdict"]) == {"basis", "uses", "sentences", "comparisons", "costs"}
    few = many(2, "ekf")
    (line,) = document("r", "", 0, few, verdicts(few), "", {})["datasets"][0]["lines"]
    assert line["estimates"]["ate_m"]["low"] is None
    part = run(*(row("ekf", seed) for seed in range(7)), row("ekf", 7, "error"))
    (line,) = document("r", "", 1, part, verdicts(part), "", {})["datasets"][0]["lines"]
    assert float(line["estimates"]["ate_m"]["high"]) == math.inf


@pytest.mark.slow
def test_a_run_in_a_terminal_is_all_of_it(tmp_path: Path) -> None:
    """A pseudo-terminal of 60 columns, from the command's start to its last line."""
    code = (
        "import sys; from slamduel.bench.run import benchmark; from slamduel.bench import cli; "
        "from slamduel.bench.report.section import recorded; benchmark.write_report = recorded;"
        "sys.exit(cli.main(sys.argv[1:]))"
    )
    words = ["run", "--dataset", "circle[steps=30]", "--backend", "dead-reckoning,ekf", "--seeds", "2"]
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words, "--out", str(tmp_path / "run")],
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "60", "LINES": "30"},
    )
    os.close(theirs)
    said = b""
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        said += part
    os.close(ours)
    text = said.decode()
    assert process.wait(timeout=60) == 0
    assert "preparing logs" in text
    assert "\x1b[?25l" in text
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l")  # the cursor is back
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text.rpartition("\x1b[?25h")[2]).replace("\r", "")
    table = plain.partition("report: ")[0].splitlines()
    assert max(map(len, table)) <= 60
    assert any(line.split()[:2] == ["ekf", "2/2"] or line.split()[:1] == ["ekf"] for line in table)


def test_remarks_on_cells_that_name_other_landmarks_are_apart() -> None:
    each = (("1, 2", 0.1), ("1, 2", 0.3), ("4, 5", 0.2))
    said = [f"landmarks {ids} exchanged leave {error} m" for ids, error in each]
    found = run(*(row("ekf", seed, reason=one) for seed, one in enumerate(said)))
    assert list(cell_remarks(found)) == [
        "ekf, 2 of 3 cells: landmarks 1, 2 exchanged leave 0.1 to 0.3 m",
        "ekf, 1 of 3 cells: landmarks 4, 5 exchanged leave 0.2 m",
    ]


def test_remarks_on_cells_that_are_done_are_below_the_table_of_a_terminal_each_once() -> None:
    said = "the errors of the sightings are typically {} times what is stated; truth is known at 50 of 101 steps"
    found = run(
        *(row(one, seed, reason=said.format(f"{seed + 3}.5e4")) for one in ("ekf", "ukf") for seed in range(3)),
        row("isam2", 0),
        row("isam2", 1, "error", reason="lost; and more"),
    )
    shown = " ".join(printed(found, 100).split())
    assert (
        "cells ekf and ukf, 6 of 7 cells: the errors of the sightings are typically 3.5e4 to 5.5e4 times what" in shown
    )
    assert shown.count("what is stated") == 1
    assert "cells ekf and ukf, 6 of 7 cells: truth is known at 50 of 101 steps" in shown
    assert "cells lost" not in shown
    assert "what is stated" not in printed(found, 100, terminal=False)  # each cell has said it in its line
    many_kinds = run(*(row("ekf", seed, reason="x" * (seed + 1)) for seed in range(12)))
    assert "4 remarks more: cells.csv has them" in " ".join(printed(many_kinds, 100).split())


def test_a_truth_too_small_for_an_ate_is_not_called_a_lack_of_paths() -> None:
    found = run(*(row("ekf", seed, ate_m=None, ate_origin_m=0.2, reason="ATE takes more") for seed in range(6)))
    assert "The true path is known at fewer than 3 steps, or in one place." in " ".join(printed(found, 100).split())
    assert "no ranked backend" not in printed(found, 100)
    assert "<0.001" not in printed(found, 100)
