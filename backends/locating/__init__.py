"""Finding a robot on a given map whose start is unknown."""
