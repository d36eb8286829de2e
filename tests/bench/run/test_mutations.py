"""No mutated log gives a result that is worse without a word about it."""

import pytest

from mutations import ENDS, tried


@pytest.mark.parametrize("cases", [30, pytest.param(300, marks=pytest.mark.slow)])
def test_no_mutation_is_worse_in_silence(cases: int) -> None:
    found = list(tried(cases, seed=cases))
    assert len(found) == cases
    assert {ended.end for ended in found} <= set(ENDS)
    assert [ended for ended in found if ended.end in ("worse", "crashed")] == []
    assert {ended.end for ended in found} == {"refused", "remarked", "same"}
