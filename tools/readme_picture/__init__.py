"""Overview picture of the README."""
