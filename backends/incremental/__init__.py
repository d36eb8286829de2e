"""The incremental smoother on the forest of cliques: whole and partial sightings, fixes, constant errors, loops."""
