"""Estimators that solve a factor graph, with GTSAM."""
