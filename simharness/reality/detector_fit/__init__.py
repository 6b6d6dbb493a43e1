"""Fit of a detector profile: a real detector measured against ground truth, and the parameters that reproduce it."""
