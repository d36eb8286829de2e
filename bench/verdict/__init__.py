"""Who is better, how sure that is, what to use, what changed between two runs: sentences and numbers."""
