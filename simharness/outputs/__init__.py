"""HTML reports of a run and of a study, with their plots, pictures and films."""
