"""A log as text files, ours and others'."""
