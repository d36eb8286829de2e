"""The same robot log through several SLAM backends, and a verdict that holds up."""
