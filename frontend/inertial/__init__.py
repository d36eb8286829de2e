"""Inertial measurement units: standing still, levels by gravity, and turns between steps."""
