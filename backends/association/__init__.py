"""Data association in front of any backend that states what it expects."""
