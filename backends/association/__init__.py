"""Data association: one layer that makes up the ids of sightings, for every backend that states what it expects."""
