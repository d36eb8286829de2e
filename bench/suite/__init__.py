"""Runs named suites, keeps what they found over versions, takes in results of others, and writes one site of it all."""
