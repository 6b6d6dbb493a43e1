"""Fit of a detector and of an annotation to recordings whose detector and annotation are known."""
