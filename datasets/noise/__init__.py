"""The noise of a log as numbers: read from files, stated in logs, with errors that stay taken out."""
