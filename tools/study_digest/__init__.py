"""Digest of a study, small enough to be kept with the code."""
