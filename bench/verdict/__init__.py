"""Ranks, tests and recommends backends, and compares runs: sentences and numbers."""
