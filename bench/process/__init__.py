"""Clocks, memory and threads of the process that measures."""
