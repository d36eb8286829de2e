"""Makes a run's page: tables and figures per dataset."""
