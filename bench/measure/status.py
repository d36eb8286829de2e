"""How a cell ends: the statuses that count as the worst, and what its reason says that others look for there."""

FAILED = ("diverged", "timeout", "error")
"""Ways for a cell to end that count as the worst there is."""

TOLD = "was told the truth: linearised there"
"""In the reason of a cell whose backend made use of --oracle."""

SURVEYED = "the landmarks' true places are known, and the map is measured from them"
"""In the reason of a cell whose path is measured from a reference."""

REFERENCE = "reference: "
"""In the reason of a cell, before what the reference is where it is not the plain batch optimum."""
