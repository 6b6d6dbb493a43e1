"""Pages that people read: of one run, of a whole study; their plots, pictures and films."""
