"""Pose graphs with ground truth: walks on a grid, and formats that have the truth beside the graph."""
