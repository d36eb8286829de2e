"""Measures the front ends for markers, laser scans and depth cameras, beside references."""
