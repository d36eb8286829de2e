"""Describes a log before anything runs on it: `bench show`, `validate` and `export`."""
