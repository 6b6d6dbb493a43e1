"""Validation of simulated twins: what simulation predicts, beside what was recorded."""
