"""Logs that contradict themselves: how far their factors are from agreeing, and which usual mistake explains it."""
