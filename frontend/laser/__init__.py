"""From laser scans and odometry to odometry factors and loop closures, after Google's Cartographer."""
