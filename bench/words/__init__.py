"""Writes numbers, names, columns and backends' looks; the console."""
