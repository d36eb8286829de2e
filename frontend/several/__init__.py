"""One log of several sensors: what the scans tell without the wheels, and steps for all of them on one clock."""
