"""Reads TOML files with line numbers for errors."""
