"""Flags, help and exit statuses: a module a command."""
