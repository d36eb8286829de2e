"""Square markers: detection, pose, noise, and the log made from them."""
