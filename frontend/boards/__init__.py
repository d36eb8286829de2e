"""Boards of known markers: finding them in pictures, and calibrating a camera from these."""
