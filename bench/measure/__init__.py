"""Drives, times and scores one backend on one log: a row and arrays."""
