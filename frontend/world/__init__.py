"""Positions by GPS and headings by a compass, in the log that a front end has made."""
