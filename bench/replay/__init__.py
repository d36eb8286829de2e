"""Repeats a recorded cell, as page, film or recording."""
