"""Which tables and figures a run's page has, per dataset."""
