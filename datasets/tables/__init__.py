"""A log from CSV tables: odometry, detections, ranges, bearings, positions and headings."""
