"""Incremental smoothing in compiled code: factors, elimination, relinearisation, covariances."""
