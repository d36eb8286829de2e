"""Estimators whose belief is a set of particles: FastSLAM and its kernels."""
