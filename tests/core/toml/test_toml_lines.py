"""The lines of a TOML file's values, for any file that tomllib reads."""

import itertools
import tomllib
from collections.abc import Generator
from typing import Any

import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from slamduel.core.toml.lines import Place, lines

KEYS = st.text(st.sampled_from("ab.\" '#[]=é\\"), min_size=1, max_size=4)
VALUES = st.recursive(
    st.none(), lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=3), max_leaves=12
)


@settings(max_examples=80)
@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_every_value_is_on_the_line_where_it_is_said_to_be(tree: dict[str, Any]) -> None:
    counter = itertools.count(10_000)
    numbered = _numbered(tree, counter)
    text = tomli_w.dumps(numbered, multiline_strings=True)
    rows, found = text.split("\n"), lines(text)
    leaves = dict(_leaves(tomllib.loads(text), ()))
    assert set(leaves) <= set(found)
    for place, value in leaves.items():
        assert value.strip() in "".join(rows[found[place] - 1 :][: 1 + 2 * ("\n" in value)])


def _numbered(value: Any, counter: "itertools.count[int]") -> Any:
    """With another text in the place of every None: some over two lines, some with what looks like TOML."""
    if isinstance(value, dict):
        return {key: _numbered(inner, counter) for key, inner in value.items()}
    if isinstance(value, list):
        return [_numbered(inner, counter) for inner in value]
    n = next(counter)
    return f"\n{n}" if n % 3 == 0 else f"{n} # ] = [" if n % 3 == 1 else f"{n}"


def _leaves(value: Any, place: Place) -> Generator[tuple[Place, str]]:
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(inner, (*place, key))
    else:
        yield place, value
