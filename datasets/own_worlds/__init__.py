"""A simulated world of landmarks and way points from files."""
