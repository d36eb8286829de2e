"""A camera's lens, calibration and mounting on the robot."""
