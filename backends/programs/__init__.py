"""Other people's programs as backends, each as its users run it."""
