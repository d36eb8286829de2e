"""Times steps, corner refinements and the batch optimum, with references timed in the same process."""
