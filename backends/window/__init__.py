"""Fixed-lag smoothing: a window of the last seconds, with a prior for older data."""
