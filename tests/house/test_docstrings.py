"""The first lines of docstrings: none says what its subject is by "What X is"."""

import ast
import re
from pathlib import Path

import pytest

from places import LAYERS, ROOT

KINDS = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def opened(source: str) -> list[str]:
    """The docstrings in a source that begin with a word of a question."""
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, KINDS))
    said = [ast.get_docstring(node) or "" for node in nodes]
    return [words.partition("\n")[0] for words in said if re.match(r"(What|How|Where|Whether)\b", words)]


@pytest.mark.parametrize("layer", LAYERS)
def test_no_docstring_begins_with_the_word_of_a_question(layer: str) -> None:
    sources = {file.relative_to(ROOT): file.read_text(encoding="utf-8") for file in Path(ROOT, layer).rglob("*.py")}
    assert {str(file): found for file, text in sources.items() if (found := opened(text))} == {}


def test_such_a_docstring_is_seen() -> None:
    assert opened('"""Paths."""\n\ndef f():\n    """Where it is."""\n') == ["Where it is."]
