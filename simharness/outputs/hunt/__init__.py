"""Pages of kept failures."""
