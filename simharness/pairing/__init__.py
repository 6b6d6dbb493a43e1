"""Estimates paired one to one with the true people of a frame."""
