"""Logs made ready, with what options change in a log that is already made."""
