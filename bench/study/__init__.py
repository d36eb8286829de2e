"""A TOML file read into cells, checked, and run through an executor into the store."""
