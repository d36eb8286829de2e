"""Runs a plan into a folder, with progress and results for the terminal and `slamduel.run`."""
