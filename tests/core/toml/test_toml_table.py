"""Tables of TOML files: what is asked for is read, what cannot be is refused by file, line and key."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from refusals import refusal
from slamduel.core.scan import attempted
from slamduel.core.toml.table import TomlTable, shown

Read = Callable[[TomlTable], object]


def table(text: str) -> TomlTable:
    return TomlTable.parse("f.toml", text)


TEXT = """name = "x"
on = true
count = 3
size = 2
pair = [1, 2.5]
rows = [[1, 2], [3, 4]]
[sub]
bits = 8
[[many]]
"""


def test_every_kind_of_value_is_read(tmp_path: Path) -> None:
    (tmp_path / "f.toml").write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    found = TomlTable.read(tmp_path / "f.toml").only(("name", "on", "count", "size", "pair", "rows", "sub", "many"))
    assert (found.text("name"), found.names("name"), found.switch("on", False)) == ("x", ["x"], True)
    assert (found.whole("count", 0, 1), found.number("size", above=1)) == (3, 2.0)
    assert found.numbers("pair", 2).tolist() == [1.0, 2.5]
    assert found.numbers("rows", 2, 2).tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert found.table("sub").choice("bits", None, (8, 16)) == 8
    assert [one.entries for one in found.tables("many", "")] == [{}]
    assert found.where("count") == f"{found.file}, line 3: count"
    assert found.table("sub").where("bits") == f"{found.file}, line 8: sub.bits"


def test_what_is_not_given_is_the_default() -> None:
    found = table("blank = ''")
    assert (found.text("blank", "x"), found.text("k", ""), found.switch("k", True)) == ("", "", True)
    assert (found.whole("k", 2, 1), found.number("k", -1, above=0), found.choice("k", None, ("a",))) == (2, -1, None)
    assert found.numbers("k", 2, default=(1, 2)).tolist() == [1.0, 2.0]
    assert (found.table("k").entries, found.tables("k", ""), found.has("k")) == ({}, [], False)


def test_dotted_and_quoted_keys_are_the_same_and_stand_where_they_are() -> None:
    found = table('[k]\na.b = 1\n"a.c" = 2\nd = {}\n').table("k").flat()
    assert found == {"a.b": (1, ("k", "a", "b")), "a.c": (2, ("k", "a.c")), "d": ({}, ("k", "d"))}
    assert refusal(table("'a.b' = 1\na.b = 2").flat) == "f.toml, line 2: a.b is given twice, expected once."


NOT_TOML = {
    "a = 1\nb = = 2\n": "f.toml, line 2: not valid TOML at column 5: Invalid value; expected a TOML file.",
    "a = 1\nb = [2,\n": "f.toml, line 2: not valid TOML at its end: Invalid value; expected a TOML file.",
    "a = 1" + "0" * 5000: "f.toml: not valid TOML: Exceeds the limit (4300 digits) for integer string conversion",
    "a = " + "[" * 2000: "f.toml: found tables or lists nested hundreds deep, expected a few levels.",
}


@pytest.mark.parametrize("text", NOT_TOML)
def test_what_is_no_toml(text: str) -> None:
    assert refusal(lambda: table(text)).startswith(NOT_TOML[text])


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert refusal(lambda: TomlTable.read(tmp_path / "f.toml")) == f"{tmp_path / 'f.toml'}: there is no such file."


VALUES: dict[str, list[tuple[str, Read]]] = {
    "a text in quotes": [("3", lambda t: t.text("k", "x")), ('" "', lambda t: t.text("k"))],
    "a text or a list of texts, at least one": [(v, lambda t: t.names("k")) for v in ("3", "[]", "['a', 1]")],
    "true or false": [("1", lambda t: t.switch("k", False))],
    "one of 8, 16": [(v, lambda t: t.choice("k", None, (8, 16))) for v in ("12", "8.0", "true")],
    "one of 'a', 'b'": [("'c'", lambda t: t.choice("k", "a", ("a", "b")))],
    "a whole number, at least 1": [(v, lambda t: t.whole("k", 1, 1)) for v in ("0", "1.5", "true", "'1'")],
    "a whole number, at least 1 and at most 2,000": [("3000", lambda t: t.whole("k", 1, 1, 2000))],
    "a number": [(v, lambda t: t.number("k")) for v in ("'x'", "true", "nan", "inf", "-inf")],
    "a number above 0": [("0", lambda t: t.number("k", above=0))],
    "a number at least 0": [("-1", lambda t: t.number("k", 1.0, least=0))],
    "a number, not beyond 1e+12": [("1e13", lambda t: t.number("k"))],
    "2 numbers": [(v, lambda t: t.numbers("k", 2)) for v in ("3", "[1]", "[1, true]", "[1, nan]", "[1, 1e13]")],
    "1 x 2 numbers": [(v, lambda t: t.numbers("k", 1, 2)) for v in ("[1, 2]", "[[1, 2, 3]]", "[[1, 2], [3, 4]]")],
    "a table, [s.k] or k = { ... }": [("3", lambda t: t.table("k"))],
    "tables": [(v, lambda t: t.tables("k", "tables")) for v in ("{ a = 1 }", "[1]")],
}  # fmt: skip


@pytest.mark.parametrize(("expected", "value", "read"), [(of, *row) for of, rows in VALUES.items() for row in rows])
def test_a_value_of_another_kind_or_out_of_range(expected: str, value: str, read: Read) -> None:
    found = table(f"# a comment\n[s]\n\nk = {value}\n").table("s")
    said = f"f.toml, line 4: s.k: found {shown(found.entries['k'])}, expected {expected}."
    assert refusal(lambda: read(found)) == said


@pytest.mark.parametrize(
    ("text", "read", "sentence"),
    [
        ("a = 1\n[s]\n", lambda t: t.table("s").number("k"), "f.toml, line 2: s has no 'k', expected a number."),
        ("a = 1\n", lambda t: t.text("k"), "f.toml: the file has no 'k', expected a text in quotes."),
        ("a = 1\n", lambda t: t.table("s").numbers("k", 3), "f.toml: s has no 'k', expected 3 numbers."),
        ("[[s]]\n[[s]]\n", lambda t: t.tables("s", "")[1].names("k"), "f.toml, line 2: s has no 'k', expected a text"),
    ],
)
def test_a_key_that_has_to_be_there(text: str, read: Read, sentence: str) -> None:
    assert refusal(lambda: read(table(text))).startswith(sentence)


def test_keys_that_are_not_known() -> None:
    found = table('[s]\nsid = 1\n"" = 2\n"a\\nb" = 3\n').table("s")
    expected = "there is no such key; expected one of pose, side."
    said = [str(fault) for fault in attempted(found.unknown(("side", "pose")))]
    assert said == [
        "f.toml, line 2: s.sid: there is no such key; did you mean 'side'?",
        f"f.toml, line 3: s.'': {expected}",
        f"f.toml, line 4: s.'a\\nb': {expected}",
    ]
    assert refusal(lambda: found.only(("side", "pose"))) == said[0]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("true", "true"), ("'x'", "'x'"), ("1.50", "1.5"), ("{}", "an empty table"), ("{ a = 1 }", "a table"),
        ("2020-01-01", "the time 2020-01-01"), ("[1, 2, 3, 4, 5]", "[1, 2, 3, 4, ...]"), ("[[[[1]]]]", "[[[[...]]]]"),
        ("0x" + "f" * 5000, "a whole number beyond 64 bits"), (f"'{'x' * 80}'", f"'{'x' * 79}..."),
    ],
)  # fmt: skip
def test_what_was_found_is_shown_short(value: str, said: str) -> None:
    found: Any = table(f"k = {value}").entries["k"]
    assert shown(found) == said
