"""What a step, a corner and a pool cost, beside references timed in the same process."""
