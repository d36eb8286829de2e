"""Poses and corners of tags in a camera's frames, as files and as messages of other programs."""
