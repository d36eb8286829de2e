"""Reads a study's TOML file into cells, and estimates and shows their progress."""
