"""Errors of a sensor and of wheels that stay the same: where a sensor sits, how late it is, what is out of scale."""
