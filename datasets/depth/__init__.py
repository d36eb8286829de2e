"""Recordings of depth cameras: folders and ROS bags of colour and depth images, with the robot's description."""
