"""Tests a study's claims on its record: each holds, fails or is open, with a sentence."""
