"""Estimators whose belief is one Gaussian: dead reckoning, Kalman filters and their kernels."""
