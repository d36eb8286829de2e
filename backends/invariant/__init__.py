"""EKF-SLAM on a Lie group: the right-invariant error."""
