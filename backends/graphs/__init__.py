"""Estimators that solve a factor graph: with GTSAM, and in batch on the tree of `smoothing`."""
