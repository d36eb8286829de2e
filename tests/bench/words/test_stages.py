"""What takes long says which stage is at work and about how long the rest takes, what is quick says nothing."""

import io
import threading

import pytest
from rich.console import Console

from slamduel.bench.words import stages
from slamduel.bench.words.stages import Stages, clock

SHARES = {"reading": 1.0, "checking": 2.0, "writing": 1.0}


class Clock:
    """A clock that is moved by hand, in the place of the module time."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> Clock:
    moved = Clock()
    monkeypatch.setattr(stages, "time", moved)
    monkeypatch.setattr(stages, "PATIENCE_S", 3600.0)  # of the timer; a stage that begins tells by the clock
    return moved


def test_the_time_left_is_that_of_the_shares_at_the_pace_so_far(by_hand: Clock) -> None:
    with Stages(Console(file=io.StringIO()), SHARES) as shown:
        shown.begin("reading")
        assert shown.words == "reading"
        by_hand.now += 20
        shown.begin("checking")
        assert shown.words == "checking, about 60 s left"
        by_hand.now += 30
        assert shown.words == "checking, about 30 s left"
        by_hand.now += 50
        assert shown.words == "checking, about 20 s left", "a stage that takes longer leaves the others their time"
        shown.begin("writing")
        assert shown.words == "writing, about 30 s left", "100 s for three of four parts"


def test_elsewhere_than_on_a_terminal_lines_are_few(by_hand: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    console = Console(file=io.StringIO(), width=80)
    with Stages(console, SHARES) as shown:
        monkeypatch.setattr(stages, "PATIENCE_S", 1.0)
        shown.begin("reading")
        by_hand.now += 5
        shown.begin("checking")
        by_hand.now += 5
        shown.begin("writing")  # within AGAIN_S
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue() == "checking, about 20 s left\n"


def test_what_is_quick_or_quiet_says_nothing(by_hand: Clock) -> None:
    for quiet in (False, True):
        console = Console(file=io.StringIO(), quiet=quiet)
        with Stages(console, SHARES) as shown:
            for stage in SHARES:
                shown.begin(stage)
                by_hand.now += 7200 * quiet
        assert isinstance(console.file, io.StringIO)
        assert console.file.getvalue() == ""


def test_a_first_stage_that_lasts_is_told_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "PATIENCE_S", 0.0)
    heard = threading.Event()

    class Heard(io.StringIO):
        def write(self, text: str) -> int:
            heard.set()
            return super().write(text)

    file = Heard()
    with Stages(Console(file=file, width=80), SHARES) as shown:
        shown.begin("reading")
        assert heard.wait(60)
    assert file.getvalue() == "reading\n"


def test_a_clock_has_hours_where_there_are_some() -> None:
    assert [clock(s) for s in (5.9, 200, 3800)] == ["0:05", "3:20", "1:03:20"]


def test_no_time_is_left_by_a_pace_that_has_compiling_in_it(by_hand: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    now, pieces = [False], [3]
    monkeypatch.setattr(stages, "compiling", lambda: now[0])
    monkeypatch.setattr(stages, "made", lambda: pieces[0])
    with Stages(Console(file=io.StringIO()), SHARES) as shown:
        shown.begin("reading")
        by_hand.now += 20
        shown.begin("checking")
        assert shown.words == "checking, about 60 s left"
        now[0] = True
        assert shown.words == "checking", "while it compiles"
        now[0], pieces[0] = False, 4
        assert shown.words == "checking", "and after, as the pace was that of compiling"
