"""What a study claims: a sentence, and the measure, the cells and the bounds by which it holds or does not.

Five kinds, told apart by their keys. A selection is parameter -> value; it may name a `measure` of its own.

    of, with above, below or within          the median of the measure
    less, than, with factor                  paired: the one is smaller, by at least so much
    alike, to, by                            paired: the ratio is within 1 / (1 + by) and 1 + by
    of, grows, with above, below or within   the exponent with which the measure grows with a parameter
    less, than, crosses, with within         the value of a parameter from which on the one is smaller

With `each`, a claim has to hold for every value of that parameter. What a side selects is one configuration: of every
parameter but the seed, and that of grows and crosses, one value. Two sides are paired by log, which is what a seed
makes. `where` and `each` say nothing of a side none of whose cells has the parameter: dead reckoning has no particles.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal

Selection = Mapping[str, Any]


@dataclass(frozen=True)
class Claim:
    """A claim to be tested, one of five kinds."""

    kind: Literal["value", "less", "alike", "grows", "crosses"]
    says: str
    measure: str
    first: Selection  # of, less or alike
    second: Selection  # than or to; empty where there is one side only
    low: float = -inf
    high: float = inf  # the bounds that the interval has to keep to; less has its factor as `low`
    along: str = ""  # of grows and crosses
    each: str = ""
    where: Selection = field(default_factory=dict[str, Any])  # of both sides
