"""Logs as text files, in our formats and others'."""
