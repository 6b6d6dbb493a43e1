"""Draws the picture at the top of the README."""
