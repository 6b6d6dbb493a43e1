"""Regression gate: comparison of a suite with its committed baseline."""
