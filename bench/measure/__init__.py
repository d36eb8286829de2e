"""One backend on one log: drive it, time it, judge it; a row and arrays."""
