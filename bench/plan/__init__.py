"""Makes backends, datasets, options, seeds and a given map, as named by a user, into cells and logs."""
