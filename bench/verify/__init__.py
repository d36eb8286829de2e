"""Checks a run's folder that somebody else made: its files, its logs, its scores, and a sample of its cells."""
