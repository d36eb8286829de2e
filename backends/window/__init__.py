"""Fixed-lag smoothing: a window of the last seconds, and a prior of what is older."""
