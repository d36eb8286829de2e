"""Square markers: found in an image, measured, and made into sightings and a log."""
