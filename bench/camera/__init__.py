"""Printed markers, a calibration's picture, and recordings made into logs with reports."""
