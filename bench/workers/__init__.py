"""Runs jobs in a process, a pool, on Dask or SLURM, and handles workers that die."""
