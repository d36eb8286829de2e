"""Times steps and the batch optimum, with references timed in the same process."""
