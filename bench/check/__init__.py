"""The conformance suite of a backend."""
