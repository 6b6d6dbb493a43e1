"""Trials: run, stored, reported."""
