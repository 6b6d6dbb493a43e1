"""Placement of objects: clear of people and cameras, by kind, number and coverage of the views."""
