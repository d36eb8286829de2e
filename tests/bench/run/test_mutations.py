"""No mutated log, recording, plug-in or record gives a result that is worse, or another verdict, without a word."""

import pytest

from mutants.ending import ENDS
from mutants.families import FAMILIES

QUICK = {"csv": 7, "folders": 12, "bags": 5, "plug-ins": 5, "records": 3}
SLOW = 60  # of each family


@pytest.mark.parametrize(
    ("family", "cases"), [*QUICK.items(), *(pytest.param(name, SLOW, marks=pytest.mark.slow) for name in FAMILIES)]
)
def test_no_mutation_is_worse_in_silence(family: str, cases: int) -> None:
    found = list(FAMILIES[family](cases, cases))
    assert len(found) == cases
    assert {ended.end for ended in found} <= set(ENDS)
    assert [ended for ended in found if ended.end in ("worse", "crashed")] == []
    assert cases < SLOW or {ended.end for ended in found} == {"refused", "remarked", "same"}


def test_every_family_is_tried() -> None:
    assert QUICK.keys() == FAMILIES.keys()
