"""Measures the noise of a log: its size, its tails, and its correlation in time."""
