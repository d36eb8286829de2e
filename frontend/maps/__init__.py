"""Maps from what lies beside a log: occupancy grids, views from above and clouds of points, along any path."""
