"""What the arrays of a line's cells say beyond their rows: J by its terms, the state of particles, gated sightings."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .cost import TERMS
from .store import Row, Store
from .summary import Line, spread

ARRAYS = ("cost_terms", "final_map_ids", "n_eff", "ancestors", "refused")


def diagnosed(store: Store, line: Line) -> Line:
    """`line` with the values of `definitions.WORKED_OUT` that its cells' arrays hold, each over the seeds."""
    found = [_values(row, store.arrays(row, ARRAYS)) for row in line.rows if row.columns["status"] == "done"]
    names = dict.fromkeys(name for values in found for name in values)
    more = {name: spread([values[name] for values in found if name in values]) for name in names}
    return line._replace(values={**line.values, **more})


def _values(row: Row, arrays: Mapping[str, Any]) -> dict[str, float]:
    """A cell's; what its backend does not tell is absent, and a loop term where no loop is closed."""
    values: dict[str, float] = {}
    if "cost_terms" in arrays:
        terms = dict(zip(TERMS, arrays["cost_terms"].tolist(), strict=True))
        values |= {f"j_{name}": term for name, term in terms.items() if name != "loops" or term}
        values["j_final" if "final_map_ids" in arrays else "j_online"] = sum(terms.values())
    for name, array, told in (("n_eff_least", "n_eff", np.min), ("ancestors_left", "ancestors", _last)):
        known = arrays.get(array, np.zeros(0))
        known = known[np.isfinite(known)]
        if len(known):
            values[name] = float(told(known))
    refused = int(arrays.get("refused", np.zeros(0)).sum())
    if refused:
        values["refused_share"] = refused / row.columns["sightings"]
    return values


def _last(values: Any) -> float:
    return values[-1]
