"""The statuses of a cell."""

STATUSES = ("done", "diverged", "timeout", "error", "skipped")

FAILED = ("diverged", "timeout", "error")
"""Those that count as the worst error."""
