"""Markers on paper, a calibration's picture, a recording made into a log with its report."""
