"""Published logs: downloaded, verified, unpacked and read."""
