"""TOML files, read table by table with their lines at hand."""
