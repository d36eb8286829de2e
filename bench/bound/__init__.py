"""The least error that a log allows: its Cramér-Rao bound."""
