"""Profiles of networks: how they err in rendered pictures, whose truth is exact, and whether a profile says so."""
