"""Simulated logs from known models; no file is read."""
