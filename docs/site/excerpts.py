"""Reads docs/equations.toml and finds the lines of code and the tests that it names."""

import ast
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]


class Excerpt(NamedTuple):
    """Consecutive lines of a file."""

    file: str  # from the checkout's root
    name: str  # of the function, class or method they are in
    first: int  # number of the first line
    text: str


class Equation(NamedTuple):
    """An equation, or a few that belong together, and what holds it."""

    number: str
    title: str
    tex: str
    erratum: str | None
    code: list[Excerpt]
    tests: list[Excerpt]


class Document(NamedTuple):
    """One of the documents."""

    title: str
    note: str
    equations: list[Equation]


def documents(path: Path = ROOT / "docs" / "equations.toml") -> list[Document]:
    """The documents with their equations. ValueError names what a file does not have."""
    with path.open("rb") as file:
        given = tomllib.load(file)["document"]
    return [Document(one["title"], one["note"], [_equation(each) for each in one["equation"]]) for one in given]


def _equation(given: dict[str, Any]) -> Equation:
    code = [excerpt(one["file"], one["of"], one.get("at"), one.get("lines")) for one in given["code"]]
    tests = [excerpt(*name.split("::")) for name in given["tests"]]
    return Equation(given["number"], given["title"], given["tex"], given.get("erratum"), code, tests)


def excerpt(file: str, name: str, at: str | None = None, lines: int | None = None) -> Excerpt:
    """The definition of `name`, with its decorators; or `lines` lines of it from the first one that has `at`."""
    source = (ROOT / file).read_text(encoding="utf-8")
    node: ast.AST = ast.parse(source)
    for part in name.split("."):
        found = [one for one in getattr(node, "body", []) if getattr(one, "name", None) == part]
        if not found:
            raise ValueError(f"{file}: no {name}")
        node = found[0]
    assert isinstance(node, ast.FunctionDef | ast.ClassDef)
    first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
    last = node.end_lineno or first
    text = source.splitlines()
    if at is not None:
        begin = next((row for row in range(first, last + 1) if at in text[row - 1]), None)
        if begin is None:
            raise ValueError(f"{file}: no line of {name} has {at!r}")
        first, last = begin, begin + (lines or 1) - 1
    return Excerpt(file, name, first, "\n".join(text[first - 1 : last]))
