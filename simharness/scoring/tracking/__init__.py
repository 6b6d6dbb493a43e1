"""Scores over time: whether people keep their identities, and how smoothly and where they move."""
