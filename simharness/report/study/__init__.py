"""The page of a study: curves, breaking points, failures, worst frames."""
