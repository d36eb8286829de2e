"""Data association in front of any backend that states what it expects, and the start of one on a given map."""
