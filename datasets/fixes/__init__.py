"""Readings of GPS receivers in files and bags, and what robot.toml says of these and of a compass."""
