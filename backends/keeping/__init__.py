"""The smoother whose cost follows the area: poses where nothing is new are marginalised into submaps of landmarks."""
