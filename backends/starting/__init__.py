"""Late starts: the place of a landmark by sightings that each tell a part, and when it is known well enough."""
