"""A room, a lens and light, as frames with true poses."""
