"""The statuses of a cell."""

FAILED = ("diverged", "timeout", "error")  # statuses that count as the worst error
