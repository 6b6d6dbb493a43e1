"""Distinct failures that the search of a hunt, random points and Latin hypercubes find in the same number of trials."""
