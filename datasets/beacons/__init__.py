"""Published logs of radio and acoustic beacons, whose sightings are ranges alone."""
