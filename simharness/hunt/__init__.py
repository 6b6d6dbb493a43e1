"""Failures of single frames: found by search, shrunk to the fewest people, cameras and errors that show them, kept."""
