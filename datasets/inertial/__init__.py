"""Readings of inertial measurement units in files and bags, with their mounting and units."""
