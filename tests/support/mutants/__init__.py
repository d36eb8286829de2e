"""Mutated logs, recordings, plug-ins and records, and how each has to end."""
