"""Runs the cells of a run or of a study into its record, each result once."""
