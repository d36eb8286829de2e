"""Estimators with a single Gaussian belief: dead reckoning, Kalman filters and their kernels."""
