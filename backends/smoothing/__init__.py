"""Incremental smoothing in compiled code of its own: factors, elimination, relinearising, covariances."""
