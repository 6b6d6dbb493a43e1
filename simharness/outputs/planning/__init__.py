"""Pages of rehearsals and plans."""
