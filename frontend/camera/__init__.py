"""A camera: its lens, its calibration, and where on the robot it sits."""
