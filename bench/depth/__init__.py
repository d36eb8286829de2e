"""Recordings of depth cameras made into logs with reports."""
