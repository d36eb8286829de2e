"""Estimators with a particle belief: FastSLAM and its kernels."""
