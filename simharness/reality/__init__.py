"""Recorded data sets, their evaluation protocols, fitted detectors and simulated twins."""
