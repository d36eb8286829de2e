"""Data association in front of any backend, and the start of one on a given map."""
