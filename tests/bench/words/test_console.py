"""What a backend is called, or has said, reaches the terminal letter by letter."""

import io

import pytest

from slamduel.bench.words.console import plain, screen_console


@pytest.mark.parametrize(
    "text", ["mine:x:y", "base:zero:", "[bold]x[/]", "[[nan nan] [0. 1.]]", r"a\[b]c", "[/]", "ekf[gate=0.9]"]
)
def test_text_is_printed_as_it_is(text: str) -> None:
    console = screen_console(quiet=False)
    console.file = io.StringIO()
    console.print(f"[green]done[/] {plain(text)}", highlight=False, soft_wrap=True)
    assert console.file.getvalue() == f"done {text}\n"
