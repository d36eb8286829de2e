"""Recordings of cameras, depth cameras and laser scanners made into logs with reports."""
