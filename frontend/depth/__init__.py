"""A depth camera: frames one after another become steps with landmarks or loop closures."""
