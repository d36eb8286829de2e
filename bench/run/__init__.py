"""A whole run: plan to folder, progress, what the terminal and `slamduel.run` show."""
