"""One-off tools that make what the project ships; never imported by the packages."""
