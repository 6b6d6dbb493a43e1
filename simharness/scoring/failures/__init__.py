"""Failures of estimates: their classes, and the stage of the method to blame for each."""
