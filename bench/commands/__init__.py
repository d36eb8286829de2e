"""Flags, help and exit statuses: one module per command."""
