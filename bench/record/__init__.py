"""What is kept on disk of a run or study, how it is read back, and what code and machine made it."""
