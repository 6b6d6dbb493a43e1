"""Processes, progress and files: what every long command needs and no result depends on."""
