"""From the frames of a depth camera and wheel odometry to odometry, landmarks and loop closures."""
