"""What a user named, backends, datasets, options, seeds, a given map, as cells and logs that are ready."""
