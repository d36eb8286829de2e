"""Writes and reads the records of runs and studies, with fingerprints of code and machine."""
