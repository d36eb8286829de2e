"""What a log is, before anything runs on it: `bench show`, `validate` and `export`."""
