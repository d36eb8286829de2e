"""Recordings of laser scans: ROS bags and CARMEN logs, with the robot's description."""
