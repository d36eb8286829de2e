"""How a cell ends: the statuses that count as the worst."""

FAILED = ("diverged", "timeout", "error")
"""Ways for a cell to end that count as the worst there is."""
