"""A function takes at most ten positional parameters, or a comment above it gives the reason."""

import ast
from collections.abc import Iterator

import pytest

from places import LAYERS, ROOT

MOST = 10


def long_ones(source: str) -> Iterator[str]:
    """Functions with more than that without a comment directly above, as `line name: count`."""
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        count = len(node.args.posonlyargs) + len(node.args.args)
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        if count > MOST and not (first > 1 and lines[first - 2].lstrip().startswith("#")):
            yield f"{node.lineno} {node.name}: {count}"


@pytest.mark.parametrize("layer", LAYERS)
def test_no_function_of_the_package_takes_more(layer: str) -> None:
    files = sorted((ROOT / layer).rglob("*.py"))
    assert files
    assert [f"{file.relative_to(ROOT)}:{one}" for file in files for one in long_ones(file.read_text("utf-8"))] == []


def test_one_that_takes_more_is_seen_unless_it_says_why() -> None:
    longer = f"def f({', '.join(f'x{k}' for k in range(MOST + 1))}):\n    pass\n"
    assert list(long_ones(longer)) == [f"1 f: {MOST + 1}"]
    assert list(long_ones("@compiled\n" + longer)) == [f"2 f: {MOST + 1}"]
    assert list(long_ones("# As the equation has them.\n@compiled\n" + longer)) == []
    assert list(long_ones(longer.replace(", x0", "").replace("x0, ", ""))) == []
