"""Makes logs ready for backends: turns (name, options, seed) into a log.

Noise is drawn anew here, false loops are planted, ids hidden, signatures given, sightings reduced to a part, fixes,
turns of a gyro, wheels' slip and maps given, so that the log is otherwise that without these options, and cached once.
"""

from dataclasses import fields, replace
from typing import Any

from ...core.factors import Dataset
from ..cache import cached, generator
from ..false_loops import FalseLoops, planted
from ..hidden_ids import KNOWN, HiddenIds, hidden
from ..on_map import OnMap, on_map
from ..redrawn import Drawn, draws, redrawn
from ..registry import Named, Source
from .fixes import WorldFixes, with_fixes
from .gyro import WorldGyro, with_gyro
from .parts import Parts, with_parts
from .signatures import WorldSignatures, with_signatures
from .slip import WorldSlip, with_slip


def made_ready(name: str, source: Source, options: Any, seed: int) -> Dataset:
    """Makes the dataset `name` of `source`, with `options`, for `seed`; InputError if that fails."""
    seed = seed if source.draws(options) else 0
    if isinstance(grid := getattr(options, "grid", None), str):
        options = replace(options, grid=grid.replace("*", str(seed)))
    own = options
    if isinstance(options, Named):
        own = replace(own, name=None)
    if isinstance(options, HiddenIds):
        own = replace(own, ids=KNOWN)
    for changing in (OnMap, Parts, WorldFixes, WorldGyro, WorldSignatures, WorldSlip):
        if isinstance(options, changing):
            own = replace(own, **{one.name: one.default for one in fields(changing)})
    if isinstance(options, FalseLoops):
        own = replace(own, false_loops=0.0)
    if isinstance(options, Drawn):
        own = replace(own, draw=False)
    dataset = cached(name, source, own, seed if source.seeded else 0)
    if draws(options):
        dataset = redrawn(dataset, generator(f"noise of {name}", seed))
    if isinstance(options, FalseLoops):
        dataset = planted(dataset, options.false_loops, generator(f"false loops of {name}", seed))
    if isinstance(options, HiddenIds):
        dataset = hidden(dataset, options.ids, generator(f"ids of {name}", seed))
    if isinstance(options, WorldSignatures):
        dataset = with_signatures(dataset, options, generator(f"signatures of {name}", seed))
    if isinstance(options, Parts):
        dataset = with_parts(dataset, options, generator(f"parts of {name}", seed))
    if isinstance(options, WorldFixes):
        dataset = with_fixes(dataset, options, generator(f"fixes of {name}", seed))
    if isinstance(options, WorldSlip):
        dataset = with_slip(dataset, options, generator(f"slip of {name}", seed))
    if isinstance(options, WorldGyro):
        dataset = with_gyro(dataset, options, generator(f"gyro of {name}", seed))
    return on_map(dataset, options, generator(f"map of {name}", seed)) if isinstance(options, OnMap) else dataset
