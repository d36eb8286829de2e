"""How a robot says that it moved: wheel counters, encoders, and odometry from elsewhere."""
