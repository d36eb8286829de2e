"""A simulated building that a robot patrols for days."""
