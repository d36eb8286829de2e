"""Robot motion: wheel counters, encoders, and odometry from elsewhere."""
