"""Cases of one proof in two tiers: the first for the quick tests, the rest for the slow ones."""

from collections.abc import Iterable
from typing import Any

import pytest


def first_quick(cases: Iterable[Any], quick: int = 1) -> list[Any]:
    """The cases of a parametrised test, all but the first `quick` marked slow; tuples are several arguments."""
    return [
        case if i < quick else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow)
        for i, case in enumerate(cases)
    ]
