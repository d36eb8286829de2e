"""Ground truth: its checks, its own errors, and its files."""
