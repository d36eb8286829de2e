"""A filter whose state has the slow errors of sightings."""
