"""Messages of ROS bags: topics, odometry, and the frames that tf knows."""
