"""The small algebra of kernels stands once, in core/kernels: no second wrap, Cholesky factor, 3x3 inverse, rotation."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from places import LAYERS, ROOT

HOME = ROOT / "core" / "kernels"
NAMES = {"wrap", "dot", "cross", "cholesky", "rodrigues"}
ROW_BY_ROW = {"backends/_joint_compatibility.py": "extended", "backends/association/_merging.py": "weigh"}
"""Functions that extend a Cholesky factor by the rows of one more variable."""


def called(node: ast.AST, *names: str) -> bool:
    """Whether the node calls a function of one of these names, of a module or not."""
    return isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in names


def is_pi(node: ast.AST) -> bool:
    return ast.unparse(node).split(".")[-1] == "pi"


def factors(node: ast.expr) -> list[ast.expr]:
    """The factors of a product."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        return factors(node.left) + factors(node.right)
    return [node]


def is_cross_product(node: ast.AST) -> bool:
    """Three differences of products side by side, of which each number is in two: also a row of a 3x3 inverse."""
    if not isinstance(node, ast.Tuple | ast.List):
        return False
    triple = [x for x in node.elts if isinstance(x, ast.BinOp) and is_difference_of_products(x)]
    numbers = Counter(ast.unparse(x) for one in triple for side in (one.left, one.right) for x in factors(side))
    return len(triple) >= 3 and min(numbers.values()) >= 2


def is_difference_of_products(node: ast.AST) -> bool:
    """a b - c d of single numbers."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub)):
        return False
    sides = factors(node.left), factors(node.right)
    return all(len(side) == 2 and all(isinstance(x, ast.Name | ast.Subscript) for x in side) for side in sides)


def is_column_product(node: ast.AST) -> bool:
    """rest -= L[i, k] * L[j, k]"""
    if not (isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Sub)):
        return False
    pair = [ast.unparse(x.slice).split(", ") for x in factors(node.value) if isinstance(x, ast.Subscript)]
    return len(pair) == 2 and all(len(index) == 2 for index in pair) and pair[0][1] == pair[1][1]


def is_root_of_rest(node: ast.AST) -> bool:
    """sqrt(... - l * l)"""
    if not (isinstance(node, ast.Call) and called(node, "sqrt")):
        return False
    inside = node.args[0]
    if not (isinstance(inside, ast.BinOp) and isinstance(inside.op, ast.Sub)):
        return False
    last = [ast.unparse(x) for x in factors(inside.right)]
    return len(last) == 2 and last[0] == last[1]


def is_wrap(node: ast.AST) -> bool:
    """2 pi floor(...), or the rest of a division by a multiple of pi"""
    if not isinstance(node, ast.BinOp):
        return False
    if isinstance(node.op, ast.Mod):
        return any(is_pi(x) for x in factors(node.right))
    parts = factors(node)
    return any(is_pi(x) for x in parts) and any(called(x, "floor", "ceil", "round", "rint") for x in parts)


def is_rotated_covariance(node: ast.AST) -> bool:
    """2 c s xy"""
    parts = sorted(ast.unparse(x) for x in factors(node)) if isinstance(node, ast.BinOp) else []
    return parts[:1] in (["2"], ["2.0"]) and {"c", "s"} <= {*parts}


def is_rodrigues(node: ast.AST) -> bool:
    """(1 - cos a) / ..."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and isinstance(node.left, ast.BinOp)):
        return False
    return isinstance(node.left.op, ast.Sub) and called(node.left.right, "cos")


def copies(source: str) -> Iterator[str]:
    """What the functions of a file have of the small algebra, as `line name: what`."""
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        nodes = list(ast.walk(function))
        found = {
            "a name of core/kernels": function.name.lstrip("_") in NAMES,
            "wraps an angle": any(map(is_wrap, nodes)),
            "a Cholesky factor": any(map(is_root_of_rest, nodes))
            or (any(map(is_column_product, nodes)) and any(called(node, "sqrt") for node in nodes)),
            "cross products or a 3x3 inverse": any(map(is_cross_product, nodes)),
            "rotates a covariance": any(map(is_rotated_covariance, nodes)),
            "Rodrigues' formula": any(map(is_rodrigues, nodes)),
        }
        yield from (f"{function.lineno} {function.name}: {what}" for what, is_there in found.items() if is_there)


def kernels() -> list[Path]:
    files = [file for layer in LAYERS for file in (ROOT / layer).rglob("_*.py") if HOME not in file.parents]
    return [file for file in files if "@compiled" in file.read_text(encoding="utf-8")]


def test_kernels_take_the_small_algebra_from_core() -> None:
    assert len(kernels()) > 50
    found = [
        f"{file.relative_to(ROOT).as_posix()}:{re.sub('^[0-9]+', '', one)}"
        for file in kernels()
        for one in copies(file.read_text("utf-8"))
    ]
    assert sorted(found) == [f"{file}: {function}: a Cholesky factor" for file, function in ROW_BY_ROW.items()]


PLANTED = {
    "wraps an angle": (
        "turned = angle - 2 * pi * floor((angle + pi) / (2 * pi))",
        "turn -= 2 * pi * np.floor(turn / (2 * pi) + 0.5)",
        "off[2] = (off[2] + np.pi) % (2 * np.pi) - np.pi",
        "angle -= math.ceil((angle - math.pi) / (2 * math.pi)) * 2 * math.pi",
    ),
    "a Cholesky factor": (
        "l10 = A[1, 0] / l00\n    l11 = sqrt(A[1, 1] - l10 * l10)",
        "for k in range(j):\n        rest -= L[i, k] * L[j, k]\n    L[i, i] = math.sqrt(rest)",
    ),
    "cross products or a 3x3 inverse": (
        "return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])",
        "W[0, 0], W[0, 1], W[0, 2] = d * f - e * e, c * e - b * f, b * e - c * d",
    ),
    "rotates a covariance": ("P[0, 0] += c * c * qxx - 2 * c * s * qxy + s * s * qyy",),
    "Rodrigues' formula": ("two = (1.0 - cos(a)) / (a * a)",),
}


@pytest.mark.parametrize(("what", "line"), [(what, line) for what, lines in PLANTED.items() for line in lines])
def test_a_copy_is_seen(what: str, line: str) -> None:
    assert list(copies(f"def f():\n    {line}\n")) == [f"1 f: {what}"]


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_function_of_such_a_name_is_seen(name: str) -> None:
    assert list(copies(f"def _{name}(a):\n    return a\n")) == [f"1 _{name}: a name of core/kernels"]
