"""Renders a room, seen through a lens under changing light, as frames with true poses."""
