"""Logs that others have published: where from, checked, unpacked, read."""
