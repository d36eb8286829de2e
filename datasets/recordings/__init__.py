"""Recordings: frames and wheel counts as files or bags, read and written."""
