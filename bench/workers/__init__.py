"""Where a job runs, a process, a pool, Dask or SLURM, and what becomes of one that dies."""
