"""What a backend is called, or has said, reaches the terminal letter by letter."""

import io
import threading

import pytest

from slamduel.bench.words import console as consoles
from slamduel.bench.words.console import COMPILING, announced, plain, screen_console


@pytest.mark.parametrize(
    "text", ["mine:x:y", "base:zero:", "[bold]x[/]", "[[nan nan] [0. 1.]]", r"a\[b]c", "[/]", "ekf[gate=0.9]"]
)
def test_text_is_printed_as_it_is(text: str) -> None:
    console = screen_console(quiet=False)
    console.file = io.StringIO()
    console.print(f"[green]done[/] {plain(text)}", highlight=False, soft_wrap=True)
    assert console.file.getvalue() == f"done {text}\n"


def test_what_takes_long_is_announced_while_it_lasts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(consoles, "PATIENCE_S", 0.0)
    told, heard = list[str](), threading.Event()

    def say(sentence: str) -> None:
        told.append(sentence)
        heard.set()

    with announced("reading a long log", say):
        assert heard.wait(60)
    assert told == ["reading a long log"]


def test_a_compiler_at_work_is_announced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(consoles, "PATIENCE_S", 0.0)
    asked, told, heard = list[bool](), list[str](), threading.Event()

    def third_time() -> bool:
        asked.append(len(asked) == 2)
        return asked[-1]

    def say(sentence: str) -> None:
        told.append(sentence)
        if len(told) == 2:
            heard.set()

    monkeypatch.setattr(consoles, "compiling", third_time)
    with announced("looking at a log", say):
        assert heard.wait(60)
    assert told == ["looking at a log", COMPILING]
    assert asked == [False, False, True]


def test_what_is_quick_is_not_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(consoles, "PATIENCE_S", 3600.0)
    told = list[str]()
    with announced("reading a log", told.append):
        pass
    assert told == []
