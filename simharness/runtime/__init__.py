"""Processes, stages, tables and versions: tools of every long command, on which no result depends."""
