"""How numbers, names, columns and backends' colours are written; the console."""
