"""EKF-SLAM whose linearisations are unscented transforms."""
