"""Measures marker detection and laser scan matching: cost, accuracy and consistency, beside references."""
