"""Laser scans made into logs with reports."""
