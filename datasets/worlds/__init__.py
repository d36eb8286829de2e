"""Logs drawn from models that are known; no file is read."""
